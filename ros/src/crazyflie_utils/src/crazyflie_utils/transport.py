"""The interface of a process to other processes.

`RosTransport` uses rospy, `FakeTransport` is for unit tests; everything else of a `NodeHandle` is
the same for both.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    # Scripts with ideal vehicles need `ServiceError`, and no ROS.
    import genpy


class ServiceError(Exception):
    """A service refused or failed; the text is the reason, for the caller."""


class ExternalPublisher(ABC):
    """Publishes one topic to other processes."""

    @abstractmethod
    def has_subscribers(self) -> bool:
        """Return whether another process subscribes."""

    @abstractmethod
    def publish(self, *messages: genpy.Message) -> None:
        """Send messages to other processes."""

    @abstractmethod
    def close(self) -> None:
        """End the publication."""


class ExternalSubscriber(ABC):
    """Receives one topic from other processes."""

    @abstractmethod
    def has_publishers(self) -> bool:
        """Return whether another process publishes."""

    @abstractmethod
    def close(self) -> None:
        """End the subscription."""


class Transport(ABC):
    """Parameters, topics, services, logging and life time, by absolute names."""

    #: Whether this thread runs callbacks, which must not wait for the master.
    is_in_callback: Callable[[], bool] = staticmethod(lambda: False)

    def starting(self) -> AbstractContextManager[None]:
        """Return a with block that initializes nodes; other processes see them at its end."""
        return nullcontext()

    @abstractmethod
    def remap(self, name: str) -> str:
        """Return the name to which the launch file remaps ``name``."""

    @abstractmethod
    def get_param(self, name: str) -> Any:
        """Return the raw value of a parameter, a dictionary of a namespace; KeyError without."""

    @abstractmethod
    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter."""

    def set_param_later(self, name: str, value: Any) -> Future[None]:
        """Set a parameter soon, without waiting for the master; by default, at once.

        The future is done in any thread.
        """
        self.set_param(name, value)
        done: Future[None] = Future()
        done.set_result(None)
        return done

    @abstractmethod
    def advertise(self, topic: str, message_type: type, latch: bool) -> ExternalPublisher:
        """Announce a topic to other processes."""

    @abstractmethod
    def subscribe(
        self, topic: str, message_type: type, deliver: Callable[[Any], None]
    ) -> ExternalSubscriber:
        """Call ``deliver(message)`` with the messages of other processes.

        That includes latched ones; a topic may be subscribed more than once.
        """

    @abstractmethod
    def advertise_service(
        self,
        name: str,
        service_type: type,
        serve: Callable[[Any, Callable[[], bool]], Future[Any]],
        time: Callable[[], float],
    ) -> Callable[[], None]:
        """Answer calls of a service with the outcome of ``serve(request, is_withdrawn)``, a future.

        ``is_withdrawn()`` returns whether the caller has given up the call. The caller gets a
        `ServiceError`, also if the process ends, or if ``time()``, the service's clock, stands
        still. Returns a function that ends the service.
        """

    @abstractmethod
    def call_service(
        self, name: str, service_type: type, request: Any, limit: float, start_limit: float
    ) -> Future[Any]:
        """Call a service and return at once; see `NodeHandle.call_service`."""

    @abstractmethod
    def service_nodes(self) -> dict[str, str]:
        """Return every service that any node offers -> the name of its node."""

    def living_node(self, name: str) -> str | None:
        """Return where a node of another process runs; None if it does not answer, by default."""
        return None

    @abstractmethod
    def log(self, level: str, text: str) -> None:
        """Log at ``level``: debug, info, warn, error or fatal."""

    @abstractmethod
    def clock_was_set(self, stamp: genpy.Time) -> None:
        """Set the transport's clock: this process, which publishes /clock, moved to ``stamp``."""
