"""Start of several vehicles by one message, or one call."""

from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Future
from typing import Any

from std_msgs.msg import String

from crazyflie_driver import srv
from crazyflie_fleet.high_level_parameters import HIGH_LEVEL, START_TOPIC
from crazyflie_mission_api.futures import forward
from crazyflie_utils import NodeHandle

_STEP = 0.02  #: Vehicles that are to start within this time, s, are named in one message.
ALL_OF_FLEET = f"/all/{HIGH_LEVEL}"  #: Namespace of a fleet's services for all.
_TIMEOUT = 60.0  #: Of a service, s of the machine's clock.


class SynchronizedStart:
    """Publishes the names of the nodes that are to start."""

    def __init__(self, handle: NodeHandle):
        self._handle = handle
        self._publisher = handle.publisher(START_TOPIC, String)
        self._names: list[str] = []
        handle.timer(_STEP, self._on_timer)

    def start(self, node: str) -> None:
        """Have a `HighLevelNode` start its uploaded trajectory 0."""
        self._handle.submit(lambda: self._names.append(node))

    def _on_timer(self):
        if self._names:
            names, self._names = self._names, []
            self._publisher.publish(String(" ".join(names)))


class BroadcastStart:
    """Starts the uploaded trajectory 0 of all vehicles of a driver by its service for all.

    Fewer than all, which are called within `_STEP`, are called one by one.
    """

    def __init__(self, handle: NodeHandle, top: str, names: Collection[str]):
        self._handle = handle
        self._service = f"{top}/start_trajectory"
        self._names = {*names}
        self._calls: dict[str, tuple[Callable[[], Future[Any]], Future[Any]]] = {}
        handle.timer(_STEP, self._on_timer)

    def start(self, name: str, call: Callable[[], "Future[Any]"]) -> "Future[Any]":
        """Start a vehicle, alone by ``call()``; return the future of the answer."""
        answer: Future[Any] = Future()
        self._handle.submit(lambda: self._calls.update({name: (call, answer)}))
        return answer

    def _on_timer(self):
        calls, self._calls = self._calls, {}
        if calls.keys() == self._names:
            request = srv.StartTrajectoryRequest(0, 0, 1.0, False, False)
            common = self._handle.call_service(
                self._service, srv.StartTrajectory, request, _TIMEOUT
            )
            for _, answer in calls.values():
                forward(common, answer)
            return
        for call, answer in calls.values():
            forward(call(), answer)


def common_services(services: Mapping[str, str], names: Collection[str]) -> str | None:
    """Return the namespace of services for exactly these vehicles, if there is one.

    ``services`` are the names of all, to the nodes that offer them.
    """
    fleet = {s.split("/")[1] for s in services if s.endswith(f"/{HIGH_LEVEL}/go_to")} - {"all"}
    if fleet:
        is_there = f"/all/{HIGH_LEVEL}/go_to" in services and fleet == {*names}
        return ALL_OF_FLEET if is_there else None
    drivers = {
        s.rpartition("/")[0].strip("/"): node
        for s, node in services.items()
        if s.endswith("/upload_trajectory")
    }
    nodes = {*drivers.values()}
    if {*drivers} == {*names} and len(nodes) == 1:
        top = f"{nodes.pop()}/all"
        return top if f"{top}/go_to" in services else None
    return None
