"""The log of a flight: a line for each change of its state."""

from collections.abc import Callable

from crazyflie_takeoff.flight_state import SEPARATOR, FlightState

_WORDS = {
    FlightState.ON_GROUND: "on the ground",
    FlightState.TAKING_OFF: "taking off",
    FlightState.FLYING: "flying",
    FlightState.DESCENDING: "landing",
    FlightState.LANDING: "landing",
}
"""What is logged; for an operator both parts of a landing are one."""


class FlightLog:
    """Logs the state of a flight when it changes, and a reason when it is new.

    Parameters
    ----------
    write : callable
        ``write(text)`` logs a line.
    state : FlightState
        Where the flight stands, as the log says already.
    """

    def __init__(self, write: Callable[[str], None], state: FlightState):
        self._write = write
        self._word = _WORDS[state]
        self._reason = ""

    def note(self, state: FlightState, reason: str) -> None:
        """Take note of the state, and why it is so; empty if there is nothing to say."""
        word = _WORDS[state]
        if word != self._word:
            is_new = reason and reason != self._reason
            self._write(f"{word}{SEPARATOR}{reason}" if is_new else word)
            self._word, self._reason = word, reason
