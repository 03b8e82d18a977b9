"""ROS interface of what all vehicles do together."""

from concurrent.futures import Future
from functools import partial
from typing import Any

from std_srvs.srv import Empty, EmptyResponse
from typing_extensions import override

from crazyflie_driver.srv import GoTo, GoToResponse
from crazyflie_fleet.fleet import Fleet
from crazyflie_fleet.lander import LIMIT, Lander, Refusals
from crazyflie_fleet.mission_watch import MISSION_LIMIT, MissionWatch
from crazyflie_fleet.sightings import Sightings
from crazyflie_utils import Node, NodeHandle, ServiceError


class FleetNode(Node):
    """Offer one service for all vehicles where each has its own.

    A call is answered when all vehicles have answered, with an error that names every one that
    has refused. Vehicles land one after the other where they are above each other; so are those
    of a mission that has died.

    Parameters
    ----------
    fleet : Fleet
    sightings : Sightings
        Of all its vehicles.
    """

    needed_in_flight = True

    def __init__(self, fleet: Fleet, sightings: Sightings):
        self._fleet = fleet
        self._sightings = sightings

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        for remark in self._fleet.remarks:
            handle.warn(remark)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._lander = Lander(handle, self._fleet, self._sightings)
        for service, call in (("takeoff", self._on_takeoff), ("land", self._on_land)):
            handle.advertise_service(f"/all/{service}", Empty, call)
            handle.advertise_service(f"/{service}_all", Empty, call)
        handle.advertise_service("/all/go_to", GoTo, self._on_go_to)
        self._missions = MissionWatch(handle, self._on_lost_mission)

    @override
    def enter_safe_state(self) -> None:
        """Tell those that wait for a landing; each vehicle has services of its own."""
        self._lander.give_up()

    def _on_takeoff(self, request):
        return self._call_all("takeoff", Empty, request, EmptyResponse())

    def _on_land(self, _):
        answer: Future[Any] = Future()
        landing = self._lander.land(self._fleet.names)
        landing.add_done_callback(lambda done: self._reply(answer, done.result(), EmptyResponse()))
        return answer

    def _on_lost_mission(self, names):
        flying = self._sightings.flying() & {*names}
        if not flying:
            return
        chosen = [name for name in self._fleet.names if name in flying]
        self._handle.error(
            f"a mission that flew {', '.join(chosen)} has said nothing for {MISSION_LIMIT:g} s and "
            "is taken for dead: landing them"
        )
        self._lander.land(chosen).add_done_callback(self._note_landing)

    def _note_landing(self, done):
        if done.result():
            self._handle.error(f"MAY STILL FLY: {self._in_words(done.result())}")

    def _reply(self, answer: Future[Any], refusals: Refusals, response: Any) -> None:
        if refusals:
            answer.set_exception(ServiceError(self._in_words(refusals)))
        else:
            answer.set_result(response)

    def _in_words(self, refusals: Refusals) -> str:
        texts = "; ".join(f"{name}: {text}" for name, text in sorted(refusals.items()))
        return f"{len(refusals)} of {len(self._fleet.vehicles)} vehicles: {texts}"

    def _on_go_to(self, request):
        if not request.relative and len(self._fleet.vehicles) > 1:
            raise ServiceError(
                "/all/go_to refused: all vehicles cannot go to one place; expected relative: true"
            )
        return self._call_all("go_to", GoTo, request, GoToResponse())

    def _call_all(self, service, service_type, request, response):
        answer: Future[Any] = Future()
        open_calls = set(self._fleet.names)
        refusals: dict[str, str] = {}

        def note(name: str, done: Future[Any]) -> None:
            error = done.exception()
            if error is not None:
                refusals[name] = str(error)
            open_calls.discard(name)
            if not open_calls:
                self._reply(answer, refusals, response)

        for name in self._fleet.names:
            call = self._handle.call_service(f"/{name}/{service}", service_type, request, LIMIT)
            call.add_done_callback(partial(note, name))
        return answer
