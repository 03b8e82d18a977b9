"""Who waits for the end of a takeoff or a landing."""

from concurrent.futures import Future
from typing import Generic, TypeVar

Response = TypeVar("Response")


class Calls(Generic[Response]):
    """Callers of services whose work takes time.

    At most one is under way. The others wait until it can be told whether theirs can begin.
    """

    def __init__(self) -> None:
        self._waiting: list[tuple[str, Future[Response]]] = []
        self._under_way: Future[Response] | None = None

    @property
    def has_waiting(self) -> bool:
        """Whether anybody waits to begin."""
        return bool(self._waiting)

    def wait(self, service: str, future: "Future[Response]") -> None:
        """Keep a call until it can begin."""
        self._waiting.append((service, future))

    def take_waiting(self) -> list[tuple[str, "Future[Response]"]]:
        """Return who waits, in the order of their calls, and forget them."""
        waiting, self._waiting = self._waiting, []
        return waiting

    def begin(self, future: "Future[Response]", reason: Exception) -> None:
        """Take note that a call is under way; one that was is ended for a reason."""
        self.fail(reason)
        self._under_way = future

    def finish(self, response: Response) -> None:
        """Answer the call that is under way, if there is one."""
        future, self._under_way = self._under_way, None
        if future is not None:
            future.set_result(response)

    def fail(self, reason: Exception) -> None:
        """End the call that is under way, if there is one."""
        future, self._under_way = self._under_way, None
        if future is not None:
            future.set_exception(reason)

    def fail_all(self, reason: Exception) -> None:
        """End all calls."""
        self.fail(reason)
        for _, future in self.take_waiting():
            future.set_exception(reason)
