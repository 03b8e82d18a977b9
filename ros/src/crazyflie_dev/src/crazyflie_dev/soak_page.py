"""The dashboard in a soak: an operator who works through what its page calls."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

from typing_extensions import override

from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.discovery import Graph
from crazyflie_dashboard.emergency import EmergencyLane
from crazyflie_dashboard.master import Master
from crazyflie_dashboard.page_data import Command
from crazyflie_dashboard.snapshot import Action
from crazyflie_dev.soak_faults import MISSIONS
from crazyflie_msgs.msg import FilterStatus, FlightStatus, PositionVelocityYawStateStamped
from crazyflie_utils import Node, NodeHandle, ServiceError
from crazyflie_utils.testing import FakeGraph

NAME = "/dashboard"
VEHICLE = "/"  #: As the dashboard names a vehicle without a namespace.

_TOPICS = {
    "/state": PositionVelocityYawStateStamped._type,
    "/in_flight_flight_status": FlightStatus._type,
    "/in_flight_filter_status": FilterStatus._type,
}


class PageNode(Node):
    """The dashboard of a fake graph, with one page that has control."""

    def __init__(self, graph: FakeGraph):
        self._graph = graph
        self._page = 0

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        """Nothing: the dashboard has none of its own."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._time = handle.time
        master, lane = _GraphMaster(self._graph), _NoLane()
        self.dashboard = Dashboard(handle, master, lane, [], handle.time, _AtOnce())

    def load(self) -> None:
        """Load the page, or load it again: it loses control and takes it."""
        if self._page:
            self.dashboard.pages.close(self._page)
        self._page = self.dashboard.pages.open(lambda text: None)
        self.dashboard.pages.take(self._page)
        self.dashboard.watch(self._page, VEHICLE)

    def close(self) -> None:
        """Close the page."""
        self.dashboard.pages.close(self._page)
        self._page = 0

    @property
    def sees_vehicle(self) -> bool:
        """Whether the page shows the vehicle, with a fresh pose."""
        shown = self.dashboard.scene().vehicles.get(VEHICLE)
        return shown is not None and not shown.is_stale

    def click(self, action: Action, lag: float) -> Future[Any]:
        """Command the vehicle by a click ``lag`` seconds ago; a refusal is a ServiceError."""
        outcome: Future[Any] = Future()

        def settle(done: Future[Any]) -> None:
            error = done.exception()
            text = str(error) if error else done.result()[VEHICLE]
            outcome.set_exception(ServiceError(text)) if text else outcome.set_result(None)

        command = Command(action, (VEHICLE,), self._time() - lag)
        self.dashboard.command(self._page, command).add_done_callback(settle)
        return outcome


class _GraphMaster(Master):
    def __init__(self, graph: FakeGraph):
        self._fake = graph

    @override
    def graph(self) -> Graph:
        # Services of missions would look like two more vehicles without a state.
        own = [name for name in self._fake.services() if not name.startswith(MISSIONS)]
        services = dict.fromkeys(own, "/node")
        # With it no process is started that would offer it.
        return Graph(_TOPICS, _TOPICS, {**services, "/high_level/go_to": "/high_level"})


class _NoLane(EmergencyLane):
    def __init__(self) -> None:
        """Emergencies are faults of the soak."""

    @override
    def close(self) -> None:
        pass


class _AtOnce(Executor):
    @override
    def submit(self, work: Callable[..., Any], /, *arguments: Any, **_: Any) -> Future[Any]:
        done: Future[Any] = Future()
        try:
            done.set_result(work(*arguments))
        except Exception as error:
            done.set_exception(error)
        return done
