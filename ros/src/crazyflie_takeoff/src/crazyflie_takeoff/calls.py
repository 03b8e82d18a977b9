"""Calls of services that are answered at the end of a takeoff or a landing."""

from concurrent.futures import Future
from typing import Generic, TypeVar

from crazyflie_takeoff.server_states import Event

Response = TypeVar("Response")


class Calls(Generic[Response]):
    """Callers of services whose work takes time.

    At most one is under way. The others wait until it is known whether theirs can begin.
    """

    def __init__(self) -> None:
        self._waiting: list[tuple[Event, Future[Response]]] = []
        self._under_way: Future[Response] | None = None

    @property
    def has_waiting(self) -> bool:
        """Whether a call waits to begin."""
        return bool(self._waiting)

    def add(self, event: Event, future: "Future[Response]") -> None:
        """Keep a call until it can begin."""
        self._waiting.append((event, future))

    def take_waiting(self) -> list[tuple[Event, "Future[Response]"]]:
        """Return the calls that wait, in their order, and forget them."""
        waiting, self._waiting = self._waiting, []
        return waiting

    def begin(self, future: "Future[Response]", reason: Exception) -> None:
        """Start a call; one that is under way fails for a reason."""
        self.fail(reason)
        self._under_way = future

    def finish(self, response: Response) -> None:
        """Answer the call that is under way, if there is one."""
        future, self._under_way = self._under_way, None
        if future is not None:
            future.set_result(response)

    def fail(self, reason: Exception) -> None:
        """Fail the call that is under way, if there is one."""
        future, self._under_way = self._under_way, None
        if future is not None:
            future.set_exception(reason)

    def fail_all(self, reason: Exception) -> None:
        """Fail all calls."""
        self.fail(reason)
        for _, future in self.take_waiting():
            future.set_exception(reason)
