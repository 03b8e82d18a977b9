"""Whether setpoints may be sent: after a lost link, or without a liftoff, a stream is blocked."""

import contextlib
import threading
from collections.abc import Iterator

PAUSE = 1.0
"""A stream that has been silent for so long, s, was begun anew by somebody who knows."""

OVERLAP = 0.5
"""After a high-level command or cmd_stop, setpoints that were on their way, since each topic has
a connection of its own, are not sent for so long, s: a single one would take the vehicle from its
planner or start its motors, and lock it 2 s later."""


class SetpointGate:
    """Decide about each setpoint; times are s of one clock.

    After a lost link, setpoints stay blocked: the vehicle may have been restarted, or its
    battery been changed, and be in somebody's hand. What shows that they are meant is that the
    vehicle still flies, a pause in the stream, zero thrust, or a call that has it fly.

    Callbacks, the link's thread and those of the vehicle's jobs use it at the same time.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._commands = 0
        self._is_emergency = False
        self._is_leaving = False
        self._is_down = False
        self._is_waiting = False
        self._has_not_lifted = False
        self._latest: float | None = None
        self._high_level_since: float | None = None
        self._stopped_since: float | None = None

    def stop_for_good(self) -> None:
        """Take note of an emergency stop."""
        with self._lock:
            self._is_emergency = True

    def leave(self) -> None:
        """Take note that the vehicle is being removed."""
        with self._lock:
            self._is_leaving = True

    def link_lost(self) -> None:
        """Take note that the link was lost."""
        with self._lock:
            self._is_down = self._is_waiting = True

    def link_back(self) -> None:
        """Take note that there is a link again."""
        with self._lock:
            self._is_down = False

    def open(self) -> None:
        """Take note of a call that has the vehicle fly."""
        with self._lock:
            self._is_waiting = self._is_down
            self._has_not_lifted = False

    def flight_goes_on(self) -> None:
        """Take note that the vehicle says that it flies, which thrust on the ground is, too."""
        with self._lock:
            self._is_waiting = self._is_down

    def not_lifted(self) -> None:
        """Take note that the vehicle was told to fly, and has not lifted off."""
        with self._lock:
            self._has_not_lifted = True

    def high_level(self, now: float) -> int:
        """Take note that the vehicle is given a high-level command; return its number."""
        with self._lock:
            self._high_level_since = now
            self._commands += 1
            return self._commands

    def resume(self, command: int) -> None:
        """Let setpoints pass again, as a command was not carried out; not if one has followed.

        Parameters
        ----------
        command : int
            Its number, from `high_level`.
        """
        with self._lock:
            if command == self._commands:
                self._high_level_since = None

    def stop(self, now: float) -> None:
        """Take note that a stream was ended by cmd_stop."""
        with self._lock:
            self._stopped_since = now

    @contextlib.contextmanager
    def passing(self, now: float, is_zero: bool) -> Iterator[str]:
        """Decide about a setpoint that is sent within the block; nothing changes meanwhile.

        Yields
        ------
        str
            See `refusal`.
        """
        with self._lock:
            yield self.refusal(now, is_zero)

    def is_blocking(self, now: float) -> bool:
        """Return whether somebody streams setpoints that are blocked because of a lost link."""
        return self._is_waiting and self._latest is not None and now - self._latest <= PAUSE

    def refusal(self, now: float, is_zero: bool) -> str:
        """Return why a setpoint must not be sent; empty if it may.

        Parameters
        ----------
        now : float
        is_zero : bool
            Whether it has the motors stand still.
        """
        with self._lock:
            return self._refusal(now, is_zero)

    def _refusal(self, now, is_zero):
        before, self._latest = self._latest, now
        if self._is_emergency:
            return "emergency stop"
        if self._is_leaving:
            return "the vehicle is being removed"
        if self._is_down:
            return "the link is lost"
        is_new = before is None or now - before > PAUSE
        if self._is_waiting and not (is_new or is_zero):
            return (
                "the link was lost, and the vehicle does not fly: pause the stream for "
                f"{PAUSE:g} s, send zero thrust or call a service that has it fly"
            )
        if self._has_not_lifted and not (is_new or is_zero):
            return (
                "the vehicle was told to fly and did not lift off: pause the stream for "
                f"{PAUSE:g} s, send zero thrust or call a service"
            )
        self._is_waiting = self._has_not_lifted = False
        for since, event in (
            (self._high_level_since, "given a high-level command"),
            (self._stopped_since, "stopped by cmd_stop"),
        ):
            if since is not None and now - since < OVERLAP and not is_zero:
                return f"the vehicle was just {event}"
        return ""
