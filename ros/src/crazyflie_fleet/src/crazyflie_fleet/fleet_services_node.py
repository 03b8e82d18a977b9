"""ROS interface of the services for all vehicles of a fleet."""

from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from std_srvs.srv import Empty, EmptyResponse
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_fleet.fleet_config import FleetConfig
from crazyflie_fleet.high_level_services import HIGH_LEVEL, START_TOPIC
from crazyflie_fleet.lander import Lander, Refusals
from crazyflie_fleet.mission_watch import MISSION_TIMEOUT, MissionWatch
from crazyflie_fleet.references_node import VehicleStates
from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils import Node, NodeHandle, ServiceError
from crazyflie_utils.refusal import refusals_text

_HIGH_LEVEL_SERVICES = {
    "land": srv.Land,
    "stop": srv.Stop,
    "go_to": srv.GoTo,
    "start_trajectory": srv.StartTrajectory,
    "notify_setpoints_stop": srv.NotifySetpointsStop,
}
#: Time after the start of this node in which a takeoff waits for vehicles that refuse it (s of the
#: machine's clock): the nodes of a hundred vehicles need a while to find each other.
START_LIMIT = 60.0
TAKEOFF_WAIT = 10.0  #: Longest time that one call waits (s of the machine's clock).
_PERIOD = 0.2  #: Period of the checks of the vehicles meanwhile (s).

_FLYING = (FlightStatus.TAKING_OFF, FlightStatus.FLYING)
_NOT_BEGUN = (FlightStatus.UNKNOWN, FlightStatus.ON_GROUND)


@dataclass
class _Call:
    """A call of a service for all; a takeoff waits until no vehicle refuses it."""

    service: str
    service_type: Any
    request: Any
    answer: "Future[Any]" = field(default_factory=Future)
    begin: float = 0.0  # Age of the node at the call (s).


class FleetServicesNode(Node):
    """Offers services for all vehicles, which call the services of each vehicle.

    A call is answered when all vehicles have answered, with an error that names each one that
    has refused. A fleet takes off as a whole or not at all. Vehicles above each other land one
    after the other, also those of a mission that has died. ``states`` are those of all vehicles of
    the fleet.
    """

    needed_in_flight = True

    def __init__(self, fleet: FleetConfig, states: VehicleStates):
        self._fleet = fleet
        self._states = states
        self._takeoffs: list[_Call] = []
        self._age = 0.0

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        for warning in self._fleet.warnings:
            handle.warn(warning)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._lander = Lander(handle, self._fleet, self._states)
        for service, call in (
            ("takeoff", partial(self._on_takeoff, "takeoff", Empty)),
            ("land", self._on_land),
        ):
            handle.advertise_service(f"/all/{service}", Empty, call)
            handle.advertise_service(f"/{service}_all", Empty, call)
        handle.advertise_service("/all/go_to", srv.GoTo, partial(self._on_go_to, "go_to"))
        path = f"{HIGH_LEVEL}/takeoff"
        takeoff = partial(self._on_takeoff, path, srv.Takeoff)
        handle.advertise_service(f"/all/{path}", srv.Takeoff, takeoff)
        for name, service_type in _HIGH_LEVEL_SERVICES.items():
            path = f"{HIGH_LEVEL}/{name}"
            call = partial(self._call_all, path, service_type)
            if name == "go_to":
                call = partial(self._on_go_to, path)
            handle.advertise_service(f"/all/{path}", service_type, call)
            if name == "start_trajectory":
                handle.advertise_service(START_TOPIC, service_type, call)
        self._missions = MissionWatch(handle, self._on_lost_mission)
        handle.timer(_PERIOD, self._on_timer, steady=True)

    @override
    def enter_safe_state(self) -> None:
        """Answer the callers of landings; each vehicle has services of its own."""
        self._lander.abort()
        takeoffs, self._takeoffs = self._takeoffs, []
        for takeoff in takeoffs:
            takeoff.answer.set_exception(
                ServiceError("no vehicle takes off: the services node has failed; see the log")
            )

    # Takeoffs.

    def _on_takeoff(self, service, service_type, request):
        if getattr(request, "groupMask", 0):
            # Only the nodes of the vehicles know their groups.
            return self._call_all(service, service_type, request)
        takeoff = _Call(service, service_type, request, begin=self._age)
        if not self._begin(takeoff):
            waiting = self._takeoff_refusals()
            self._handle.info(
                f"takeoff waits for vehicles, {TAKEOFF_WAIT:g} s at most: {self._text(waiting)}"
            )
            self._takeoffs.append(takeoff)
        return takeoff.answer

    def _on_timer(self):
        self._age += _PERIOD
        self._takeoffs = [each for each in self._takeoffs if not self._begin(each)]

    def _takeoff_refusals(self):
        """Return why vehicles that do not fly yet refuse to take off: name to reason."""
        reasons = {
            name: self._states.takeoff_refusals[self._states.numbers[name]]
            for name in self._fleet.names
            if self._states.flight_state(name) not in _FLYING
        }
        return {name: reason for name, reason in reasons.items() if reason}

    def _begin(self, takeoff):
        """Take off, or refuse; return False if the call is to wait."""
        if refusals := self._takeoff_refusals():
            if self._age < min(takeoff.begin + TAKEOFF_WAIT, START_LIMIT):
                return False
            text = f"no vehicle takes off: {self._text(refusals)}"
            takeoff.answer.set_exception(ServiceError(text))
            return True
        names = self._fleet.names
        # Vehicles in flight refuse /NAME/takeoff; they go to the height of the firmware's takeoff.
        flying = [name for name in names if self._states.flight_state(name) in _FLYING]
        if flying and takeoff.service_type is Empty:
            names = tuple(name for name in names if name not in flying)
            if not names:
                takeoff.answer.set_exception(
                    ServiceError("refused: all vehicles are flying already")
                )
                return True
            rest = ", ".join(names)
            self._handle.info(f"flying already: {', '.join(flying)}; taking off: {rest}")
        self._call_each(takeoff, names, is_takeoff=True)
        return True

    def _call_each(self, call, names, is_takeoff=False):
        """Call the services of vehicles; if one refuses a takeoff, those that have begun land."""
        open_calls = {*names}
        begun: list[str] = []
        refusals: dict[str, str] = {}
        is_aborted = False

        def on_answer(name, done):
            nonlocal is_aborted
            if is_aborted:
                return
            if done.exception() is not None:
                refusals[name] = str(done.exception())
                if is_takeoff and self._states.flight_state(name) in _NOT_BEGUN:
                    is_aborted = True
                    self._abort(call, [each for each in begun if each != name], refusals)
                    return
            open_calls.discard(name)
            if not open_calls:
                self._reply(call.answer, refusals, call.service_type._response_class())

        for name in names:
            if is_aborted:
                break
            begun.append(name)
            self._lander.call(name, call.service, call.service_type, call.request, on_answer)

    def _abort(self, takeoff, begun, refusals):
        text = f"no vehicle takes off: {self._text(refusals)}"
        if begun:
            self._handle.error(f"{text}; landing {', '.join(begun)}")
            text = f"{text}; those that had begun have landed"

        def on_landed(done):
            # A vehicle that has not begun refuses to land, too.
            failures = {
                name: reason
                for name, reason in done.result().items()
                if self._states.flight_state(name) != FlightStatus.ON_GROUND
            }
            left = f"; MAY STILL FLY: {self._text(failures)}" if failures else ""
            takeoff.answer.set_exception(ServiceError(text + left))

        self._lander.land(begun).add_done_callback(on_landed)

    # Landings, and all else.

    def _on_land(self, _):
        answer: Future[Any] = Future()
        landing = self._lander.land(self._fleet.names)
        landing.add_done_callback(lambda done: self._reply(answer, done.result(), EmptyResponse()))
        return answer

    def _on_lost_mission(self, names):
        flying = self._states.flying() & {*names}
        if not flying:
            return
        chosen = [name for name in self._fleet.names if name in flying]
        self._handle.error(
            f"no message from the mission that flew {', '.join(chosen)} for {MISSION_TIMEOUT:g} "
            "s: it has ended; landing these vehicles"
        )
        self._lander.land(chosen).add_done_callback(self._log_refusals)

    def _log_refusals(self, done):
        if done.result():
            self._handle.error(f"MAY STILL FLY: {self._text(done.result())}")

    def _reply(self, answer: Future[Any], refusals: Refusals, response: Any) -> None:
        if refusals:
            answer.set_exception(ServiceError(self._text(refusals)))
        else:
            answer.set_result(response)

    def _text(self, refusals: Refusals) -> str:
        return refusals_text(refusals, len(self._fleet.vehicles))

    def _on_go_to(self, service, request):
        if not request.relative and len(self._fleet.vehicles) > 1:
            raise ServiceError(
                f"/all/{service} refused: all vehicles cannot go to one place; expected relative: "
                "true"
            )
        return self._call_all(service, srv.GoTo, request)

    def _call_all(self, service, service_type, request):
        call = _Call(service, service_type, request)
        self._call_each(call, self._fleet.names)
        return call.answer
