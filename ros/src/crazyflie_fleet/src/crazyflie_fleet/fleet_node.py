"""ROS interface of what all vehicles do together."""

from concurrent.futures import Future
from functools import partial
from typing import Any

from std_srvs.srv import Empty, EmptyResponse
from typing_extensions import override

from crazyflie_driver.srv import GoTo, GoToResponse
from crazyflie_fleet.fleet import Fleet
from crazyflie_utils import Node, NodeHandle, ServiceError

LIMIT = 60.0
"""How long a vehicle may take to take off or to land, s of the machine's clock."""


class FleetNode(Node):
    """Offer one service for all vehicles where each has its own.

    A call is answered when all vehicles have answered, with an error that names every one that
    has refused.

    Parameters
    ----------
    fleet : Fleet
    """

    needed_in_flight = True

    def __init__(self, fleet: Fleet):
        self._fleet = fleet

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        for remark in self._fleet.remarks:
            handle.warn(remark)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        for service in ("takeoff", "land"):
            call = partial(self._on_call, service)
            handle.advertise_service(f"/all/{service}", Empty, call)
            handle.advertise_service(f"/{service}_all", Empty, call)
        handle.advertise_service("/all/go_to", GoTo, self._on_go_to)

    def _on_call(self, service, request):
        return self._call_all(service, Empty, request, EmptyResponse())

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
            if open_calls:
                return
            if refusals:
                answer.set_exception(ServiceError(_in_words(refusals, len(self._fleet.vehicles))))
            else:
                answer.set_result(response)

        for name in self._fleet.names:
            call = self._handle.call_service(f"/{name}/{service}", service_type, request, LIMIT)
            call.add_done_callback(partial(note, name))
        return answer


def _in_words(refusals: dict[str, str], number: int) -> str:
    texts = "; ".join(f"{name}: {text}" for name, text in sorted(refusals.items()))
    return f"{len(refusals)} of {number} vehicles: {texts}"
