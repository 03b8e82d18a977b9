"""What nodes say: sentences of diagnostics, lines of the log."""

from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rosgraph_msgs.msg import Log

from crazyflie_dashboard.discovery import Vehicle
from crazyflie_dashboard.snapshot import Kind, LogLine, Sentence

_MAX_AGE = 10.0  #: A diagnostic that is older, s, is not true any more.

_LEVELS = {
    Log.DEBUG: "debug",
    Log.INFO: "info",
    Log.WARN: "warn",
    Log.ERROR: "error",
    Log.FATAL: "fatal",
}

_MAX_TEXT = 2000  #: Of a line of the log, characters.


def log_line(number: int, message: Log) -> LogLine:
    """Return a message of /rosout."""
    time, level = message.header.stamp.to_sec(), _LEVELS.get(message.level, "info")
    return LogLine(number, time, level, message.name, message.msg[:_MAX_TEXT])


class Diagnostics:
    """What nodes say on /diagnostics.

    Parameters
    ----------
    time : callable
        s.
    """

    def __init__(self, time: Callable[[], float]):
        self._time = time
        self._status: dict[str, tuple[float, Any]] = {}

    def take(self, message: DiagnosticArray) -> None:
        """Take a message."""
        for status in message.status:
            self._status[status.name] = self._time(), status

    def sentences(self) -> tuple[Sentence, ...]:
        """Return what is not as it should be, errors first."""
        since = self._time() - _MAX_AGE
        fresh = [status for at, status in self._status.values() if at >= since]
        wrong = sorted(
            (each for each in fresh if each.level != DiagnosticStatus.OK),
            key=lambda each: (-each.level, each.name),
        )
        return tuple(
            Sentence(
                "warn" if each.level == DiagnosticStatus.WARN else "error", each.name, each.message
            )
            for each in wrong
        )

    def kind(self, vehicle: Vehicle) -> Kind:
        """Return what a vehicle is, by the address that its driver has for it."""
        if not vehicle.has_driver:
            return Kind.SIMULATED
        name = vehicle.driver.strip("/")
        for _, status in self._status.values():
            words = status.name.replace(":", " ").replace("/", " ").split()
            if name in words and status.hardware_id.startswith("udp://"):
                return Kind.VIRTUAL
        return Kind.REAL
