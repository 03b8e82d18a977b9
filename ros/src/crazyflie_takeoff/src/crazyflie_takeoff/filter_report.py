"""What a filter says about a flight, read by the server."""

from typing import NamedTuple

from crazyflie_takeoff.flight_state import (
    COMMANDED,
    ORIGIN,
    SEPARATOR,
    UNKNOWN,
    FlightState,
    Takeover,
)


class FilterReport(NamedTuple):
    """What a filter says.

    Attributes
    ----------
    remembered : FlightState or None
        The flight state that it heard last.
    takeover : Takeover or None
        What it has done by itself.
    is_commanded : bool
        Whether a controller sends commands, or may do so.
    reason : str
        In plain words, if there is anything to say.
    """

    remembered: FlightState | None
    takeover: Takeover | None
    is_commanded: bool
    reason: str

    @property
    def is_held(self) -> bool:
        """Whether the filter keeps a vehicle level, for which no control comes."""
        return bool(self.reason) and self.takeover is None


NO_FILTER = FilterReport(None, None, True, "")


def parse(text: str) -> FilterReport:
    """Return what a text means.

    Raises
    ------
    ValueError
        It is none of a filter's.
    """
    word, _, reason = text.partition(SEPARATOR)
    if word in (UNKNOWN, COMMANDED):
        return FilterReport(None, None, word == COMMANDED, reason)
    if word in {takeover.value for takeover in Takeover}:
        return FilterReport(None, Takeover(word), True, reason)
    if ORIGIN in word:
        word, _, origin = word.partition(ORIGIN)
        return FilterReport(FlightState(origin), Takeover(word), True, reason)
    return FilterReport(FlightState(word), None, True, reason)
