"""Messages of nodes and of the doctor: diagnostics, lines of the log, findings."""

import subprocess
from collections.abc import Callable
from typing import Any

import roslib.packages
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rosgraph_msgs.msg import Log

from crazyflie_dashboard.discovery import FoundVehicle
from crazyflie_dashboard.snapshot import Kind, LogLine, Sentence

_MAX_AGE = 10.0  #: Age after which a diagnostic is dropped (s).
_DOCTOR_TIMEOUT = 60.0  #: Longest run of the doctor (s); it gives up after 40 s itself.

_LEVELS = {
    Log.DEBUG: "debug",
    Log.INFO: "info",
    Log.WARN: "warn",
    Log.ERROR: "error",
    Log.FATAL: "fatal",
}

_MAX_TEXT = 2000  #: Length of a line of the log (characters).


def log_line(number: int, message: Log) -> LogLine:
    """Return a message of /rosout."""
    time, level = message.header.stamp.to_sec(), _LEVELS.get(message.level, "info")
    # Nodes of the workspace begin with their name, which the line has in front.
    text = message.msg.removeprefix(f"{message.name}: ")
    return LogLine(number, time, level, message.name, text[:_MAX_TEXT])


class Diagnostics:
    """Diagnostics of nodes, from /diagnostics; ``time()`` is in s."""

    def __init__(self, time: Callable[[], float]):
        self._time = time
        self._status: dict[str, tuple[float, Any]] = {}

    def take(self, message: DiagnosticArray) -> None:
        """Take a message."""
        for status in message.status:
            self._status[status.name] = self._time(), status

    def wrong(self) -> list[DiagnosticStatus]:
        """Return all diagnostics that are not OK, errors first."""
        since = self._time() - _MAX_AGE
        found = [
            status
            for at, status in self._status.values()
            if status.level != DiagnosticStatus.OK and at >= since
        ]
        return sorted(found, key=lambda each: (-each.level, each.name))

    def sentences(self) -> tuple[Sentence, ...]:
        """Return all diagnostics that are not OK, errors first."""
        words = {DiagnosticStatus.WARN: "warn"}
        return tuple(Sentence(words.get(s.level, "error"), s.name, s.message) for s in self.wrong())

    def kind(self, vehicle: FoundVehicle) -> Kind:
        """Return the kind of a vehicle, by the address that its driver has for it."""
        if not vehicle.has_driver:
            return Kind.SIMULATED
        name = vehicle.driver.strip("/")
        for _, status in self._status.values():
            words = status.name.replace(":", " ").replace("/", " ").split()
            if name in words and status.hardware_id.startswith("udp://"):
                return Kind.VIRTUAL
        return Kind.REAL


def examine() -> tuple[Sentence, ...]:
    """Run the doctor, with low priority; return its findings, errors first. It takes 10 s."""
    found = roslib.packages.find_node("crazyflie_doctor", "doctor")
    if not found:
        text, remedy = "the doctor is not installed", "build the workspace (./run build)"
        return (Sentence("error", "doctor", text, remedy),)
    try:
        done = subprocess.run(
            ["nice", "-n", "19", found[0]], capture_output=True, text=True, timeout=_DOCTOR_TIMEOUT
        )
    except subprocess.TimeoutExpired:
        text = f"it did not end within {_DOCTOR_TIMEOUT:g} s"
        return (Sentence("error", "doctor", text, "try again"),)
    return sentences(done.stdout)


def sentences(output: str) -> tuple[Sentence, ...]:
    """Return the findings in the doctor's output, errors first."""
    found = []
    for line in output.splitlines():
        level, _, rest = line.partition(" ")
        check, separator, text = rest.strip().partition(": ")
        if level in ("warn", "error") and separator:
            text, _, remedy = text.partition("; ")
            found.append(Sentence(level, f"doctor, {check}", text, remedy))
    return tuple(sorted(found, key=lambda each: each.level != "error"))
