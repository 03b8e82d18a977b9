"""ROS interface of the services for all vehicles of a fleet."""

from concurrent.futures import Future
from functools import partial
from typing import Any

from std_srvs.srv import Empty, EmptyResponse
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_fleet.fleet_config import FleetConfig
from crazyflie_fleet.high_level_parameters import HIGH_LEVEL, START_TOPIC
from crazyflie_fleet.lander import SERVICE_TIMEOUT, Lander, Refusals
from crazyflie_fleet.mission_watch import MISSION_TIMEOUT, MissionWatch
from crazyflie_fleet.vehicle_states import VehicleStates
from crazyflie_utils import Node, NodeHandle, ServiceError

_HIGH_LEVEL_SERVICES = {
    "takeoff": srv.Takeoff,
    "land": srv.Land,
    "stop": srv.Stop,
    "go_to": srv.GoTo,
    "start_trajectory": srv.StartTrajectory,
    "notify_setpoints_stop": srv.NotifySetpointsStop,
}


class FleetServicesNode(Node):
    """Offer one service for all vehicles where each has its own.

    A call is answered when all vehicles have answered, with an error that names each one that
    has refused. Vehicles above each other land one after the other, also those of a mission that
    has died. ``states`` are those of all vehicles of the fleet.
    """

    needed_in_flight = True

    def __init__(self, fleet: FleetConfig, states: VehicleStates):
        self._fleet = fleet
        self._states = states

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        for warning in self._fleet.warnings:
            handle.warn(warning)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._lander = Lander(handle, self._fleet, self._states)
        for service, call in (
            ("takeoff", partial(self._call_all, "takeoff", Empty)),
            ("land", self._on_land),
        ):
            handle.advertise_service(f"/all/{service}", Empty, call)
            handle.advertise_service(f"/{service}_all", Empty, call)
        handle.advertise_service("/all/go_to", srv.GoTo, partial(self._on_go_to, "go_to"))
        for name, service_type in _HIGH_LEVEL_SERVICES.items():
            path = f"{HIGH_LEVEL}/{name}"
            call = partial(self._call_all, path, service_type)
            if name == "go_to":
                call = partial(self._on_go_to, path)
            handle.advertise_service(f"/all/{path}", service_type, call)
            if name == "start_trajectory":
                handle.advertise_service(START_TOPIC, service_type, call)
        self._missions = MissionWatch(handle, self._on_lost_mission)

    @override
    def enter_safe_state(self) -> None:
        """Answer the callers of landings; each vehicle has services of its own."""
        self._lander.abort()

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
            f"no message of the mission that flew {', '.join(chosen)} for {MISSION_TIMEOUT:g} s: "
            "it has ended; landing them"
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
        texts = "; ".join(f"{name}: {text}" for name, text in sorted(refusals.items()))
        return f"{len(refusals)} of {len(self._fleet.vehicles)} vehicles: {texts}"

    def _on_go_to(self, service, request):
        if not request.relative and len(self._fleet.vehicles) > 1:
            raise ServiceError(
                f"/all/{service} refused: all vehicles cannot go to one place; expected relative: "
                "true"
            )
        return self._call_all(service, srv.GoTo, request)

    def _call_all(self, service, service_type, request):
        response = service_type._response_class()
        answer: Future[Any] = Future()
        open_calls = set(self._fleet.names)
        refusals: dict[str, str] = {}

        def on_answer(name: str, done: Future[Any]) -> None:
            if done.exception() is not None:
                refusals[name] = str(done.exception())
            open_calls.discard(name)
            if not open_calls:
                self._reply(answer, refusals, response)

        for name in self._fleet.names:
            path = f"/{name}/{service}"
            call = self._handle.call_service(path, service_type, request, SERVICE_TIMEOUT)
            call.add_done_callback(partial(on_answer, name))
        return answer
