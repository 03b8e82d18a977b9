"""What a process needs of the world outside it.

`RosTransport` is rospy; `FakeTransport` is a unit test. Everything else about a
`NodeHandle` is the same for both.
"""

from abc import ABC, abstractmethod
from concurrent.futures import Future


class ServiceError(Exception):
    """A service refused or failed; the text tells the caller why."""


class Outlet(ABC):
    """The way out of the process for one topic."""

    @abstractmethod
    def is_heard(self) -> bool:
        """Tell whether anyone outside this process listens."""

    @abstractmethod
    def publish(self, message) -> None:
        """Send a message to those outside."""

    @abstractmethod
    def close(self) -> None:
        """Tell those outside that no more messages come."""


class Transport(ABC):
    """Parameters, topics, services, logging and life time, by absolute names."""

    @abstractmethod
    def remap(self, name: str) -> str:
        """Return the name that the launch file puts in the place of ``name``."""

    @abstractmethod
    def get_param(self, name: str):
        """Return the raw value of a parameter; KeyError when it is not set."""

    @abstractmethod
    def set_param(self, name: str, value) -> None:
        """Set a parameter."""

    @abstractmethod
    def advertise(self, topic: str, message_type: type, latch: bool) -> Outlet:
        """Announce a topic to those outside."""

    @abstractmethod
    def subscribe(self, topic: str, message_type: type, deliver):
        """Have ``deliver(message)`` called with what those outside publish.

        Also with what they have latched; a topic may be subscribed more than once.
        Returns a function that ends it.
        """

    @abstractmethod
    def advertise_service(self, name: str, service_type: type, begin, settle):
        """Answer calls of a service with ``settle(begin(request))``.

        ``begin`` returns a Future of the response at once; ``settle`` waits for it
        and may raise `ServiceError`. Returns a function that ends the service.
        """

    @abstractmethod
    def call_service(self, name: str, service_type: type, request, limit: float) -> Future:
        """Call a service and return at once; see `NodeHandle.call_service`."""

    @abstractmethod
    def log(self, level: str, text: str) -> None:
        """Log at ``level``: debug, info, warn, error or fatal."""

    @abstractmethod
    def clock_was_set(self, stamp) -> None:
        """Take note that this process, which publishes /clock, moved to ``stamp``."""

    @abstractmethod
    def is_shutdown(self) -> bool:
        """Tell whether the process is ending."""
