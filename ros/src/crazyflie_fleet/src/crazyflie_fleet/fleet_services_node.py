"""ROS interface of the services for all vehicles of a fleet."""

from concurrent.futures import Future
from functools import partial

import genpy
from std_srvs.srv import Empty, EmptyRequest
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_fleet.fleet_config import FleetConfig
from crazyflie_fleet.high_level_services import COMMAND, HIGH_LEVEL, START_TOPIC
from crazyflie_fleet.lander import Lander, Refusals
from crazyflie_fleet.mission_watch import MISSION_TIMEOUT, MissionWatch
from crazyflie_fleet.references_node import VehicleStates
from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils import Node, NodeHandle, ServiceError
from crazyflie_utils.refusal import refusals_text
from crazyflie_utils.steps import follow

#: Time after the start of this node in which a takeoff waits for vehicles that refuse it (s of the
#: machine's clock): the nodes of a hundred vehicles need a while to find each other.
START_LIMIT = 60.0
TAKEOFF_WAIT = 10.0  #: Longest time that one call waits (s of the machine's clock).
_PERIOD = 0.2  #: Period of the checks of the vehicles meanwhile (s).

_HOLD_TIME = 1.0  #: Duration of a move to a vehicle's own position (s).

_FLYING = (FlightStatus.TAKING_OFF, FlightStatus.FLYING)
_NOT_BEGUN = (FlightStatus.UNKNOWN, FlightStatus.ON_GROUND)


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
        self._age = 0.0
        self._tick: Future[None] = Future()  # Done at the next check.

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        for warning in self._fleet.warnings:
            handle.warn(warning)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._lander = Lander(handle, self._fleet, self._states)
        for service, service_type, steps, *others in (
            ("takeoff", Empty, self._take_off, "/takeoff_all"),
            ("land", Empty, self._land, "/land_all"),
            ("go_to", srv.GoTo, self._go_to),
            ("emergency_reset", Empty, self._command),
            (f"{HIGH_LEVEL}/takeoff", srv.Takeoff, self._take_off),
            (f"{HIGH_LEVEL}/land", srv.Land, self._command),
            (f"{HIGH_LEVEL}/stop", srv.Stop, self._command),
            (f"{HIGH_LEVEL}/go_to", srv.GoTo, self._go_to),
            (f"{HIGH_LEVEL}/start_trajectory", srv.StartTrajectory, self._command, START_TOPIC),
            (f"{HIGH_LEVEL}/notify_setpoints_stop", srv.NotifySetpointsStop, self._command),
        ):
            answer = partial(self._begin, steps, service, service_type)
            for name in (f"/all/{service}", *others):
                handle.advertise_service(name, service_type, answer)
        handle.advertise_service(COMMAND, srv.CommandVehicles, partial(self._begin, self._of_some))
        self._missions = MissionWatch(handle, self._on_lost_mission)
        handle.timer(_PERIOD, self._on_timer, steady=True)

    @override
    def enter_safe_state(self) -> None:
        """Answer the callers of landings; each vehicle has services of its own."""
        self._lander.abort()
        tick, self._tick = self._tick, Future()
        tick.set_exception(
            ServiceError("no vehicle takes off: the services node has failed; see the log")
        )

    def _on_timer(self):
        self._age += _PERIOD
        tick, self._tick = self._tick, Future()
        tick.set_result(None)

    def _begin(self, steps, *arguments):
        """Begin the steps of a service; an error that is not a refusal is a fault of this node."""

        def guarded():
            try:
                return (yield from steps(*arguments))
            except ServiceError:
                raise
            except Exception as error:
                self._handle.report_fault(steps, error)
                raise ServiceError(f"{self._handle.name}: {error!r}") from None

        return follow(guarded())

    # The steps of the services; ``service`` is that of each vehicle.

    def _of_some(self, request):
        """Command the vehicles of a `CommandVehicles`."""
        names, duration = request.names, request.duration
        if unknown := [name for name in names if name not in self._fleet.names]:
            raise ServiceError(f"{', '.join(unknown)}: not of this fleet; nothing was done")
        go_to = f"{HIGH_LEVEL}/go_to"
        if request.command == "take off":
            climb = srv.TakeoffRequest(0, request.height, duration)
            yield from self._take_off(f"{HIGH_LEVEL}/takeoff", srv.Takeoff, climb, names)
        elif request.command == "land":
            self._raise((yield self._lander.land(names)))
        elif request.command == "reset":
            yield from self._command("emergency_reset", Empty, EmptyRequest(), names)
        elif request.command == "hold":
            yield from self._command(go_to, srv.GoTo, _hold(), names)
        elif request.command == "go to" and len(names) == len(request.goals) == len(request.yaws):
            goals = zip(names, request.goals, request.yaws, strict=True)
            moves = {name: srv.GoToRequest(0, False, *goal, duration) for name, *goal in goals}
            refusals, _ = yield self._call(names, go_to, srv.GoTo, moves)
            if refusals:
                begun = [name for name in names if name not in refusals]
                yield self._call(begun, go_to, srv.GoTo, _hold())
            self._raise(refusals)
        else:
            raise ServiceError(
                f"{request.command} of {len(names)} vehicles: {len(request.goals)} goals, "
                f"{len(request.yaws)} yaws; expected take off, land, hold, reset, or go to with a "
                "goal and a yaw of each"
            )

    def _take_off(self, service, service_type, request, names=None):
        names = self._fleet.names if names is None else names
        if getattr(request, "groupMask", 0):
            # Only the nodes of the vehicles know their groups.
            return (yield from self._command(service, service_type, request))
        end = min(self._age + TAKEOFF_WAIT, START_LIMIT)
        if self._age < end and (waiting := self._takeoff_refusals(names)):
            self._handle.info(
                f"takeoff waits for vehicles, {TAKEOFF_WAIT:g} s at most: {self._text(waiting)}"
            )
        while refusals := self._takeoff_refusals(names):
            if self._age >= end:
                raise ServiceError(f"no vehicle takes off: {self._text(refusals)}")
            yield self._tick
        # Vehicles in flight refuse /NAME/takeoff; they go to the height of the firmware's takeoff.
        flying = [name for name in names if self._states.flight_state(name) in _FLYING]
        if flying and service_type is Empty:
            names = [name for name in names if name not in flying]
            if not names:
                raise ServiceError("refused: all vehicles are flying already")
            rest = ", ".join(names)
            self._handle.info(f"flying already: {', '.join(flying)}; taking off: {rest}")
        refusals, idle = yield self._call(names, service, service_type, request, is_takeoff=True)
        if idle:
            yield from self._abort(refusals, [name for name in names if name not in idle])
        self._raise(refusals)

    def _takeoff_refusals(self, names):
        """Return why vehicles that do not fly yet refuse to take off: name to reason."""
        return {
            name: reason
            for name in names
            if self._states.flight_state(name) not in _FLYING
            and (reason := self._states.takeoff_refusals[self._states.numbers[name]])
        }

    def _abort(self, refusals, begun):
        """Land the vehicles that have begun to take off; raise `ServiceError`."""
        text = f"no vehicle takes off: {self._text(refusals)}"
        if begun:
            self._handle.error(f"{text}; landing {', '.join(begun)}")
            text = f"{text}; those that had begun have landed"
        failures = yield self._lander.land(begun)
        raise ServiceError(text + (f"; MAY STILL FLY: {self._text(failures)}" if failures else ""))

    def _land(self, *_):
        self._raise((yield self._lander.land(self._fleet.names)))

    def _go_to(self, service, service_type, request):
        if not request.relative and len(self._fleet.vehicles) > 1:
            raise ServiceError(
                f"/all/{service} refused: all vehicles cannot go to one place; expected relative: "
                "true"
            )
        return (yield from self._command(service, service_type, request))

    def _command(self, service, service_type, request, names=None):
        names = self._fleet.names if names is None else names
        refusals, _ = yield self._call(names, service, service_type, request)
        self._raise(refusals)

    def _call(self, names, service, service_type, request, is_takeoff=False):
        """Call the services of vehicles; return the future of their refusals.

        The request is one for all, or a dictionary with that of each. With the refusals come the
        names of those that were on the ground when they refused. A takeoff does not wait for all
        answers after the first of these.
        """
        outcome: Future[tuple[Refusals, list[str]]] = Future()
        refusals: dict[str, str] = {}
        idle: list[str] = []
        waiting = {*names}

        def on_answer(name, done):
            waiting.discard(name)
            if done.exception() is not None:
                refusals[name] = str(done.exception())
                if self._states.flight_state(name) in _NOT_BEGUN:
                    idle.append(name)
            if (not waiting or (is_takeoff and idle)) and not outcome.done():
                outcome.set_result((refusals, idle))

        if not names:
            outcome.set_result((refusals, idle))
        for name in names:
            own = request[name] if isinstance(request, dict) else request
            call = self._lander.call(name, service, service_type, own)
            call.add_done_callback(partial(on_answer, name))
        return outcome

    def _raise(self, refusals: Refusals) -> None:
        if refusals:
            raise ServiceError(self._text(refusals))

    def _text(self, refusals: Refusals) -> str:
        return refusals_text(refusals, len(self._fleet.vehicles))

    # Missions that have died.

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


def _hold():
    return srv.GoToRequest(relative=True, duration=genpy.Duration.from_sec(_HOLD_TIME))
