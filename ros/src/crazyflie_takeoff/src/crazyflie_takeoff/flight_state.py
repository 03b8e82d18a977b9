"""What server and filter tell each other about a flight."""

import enum


class FlightState(enum.Enum):
    """Where a flight stands; the values are what is published.

    A landing has two states, because the vehicle is still in flight in the
    first: the controller brings it down (`DESCENDING`) before the server takes
    over and ramps the thrust down (`LANDING`).
    """

    ON_GROUND = "on_ground"
    TAKING_OFF = "taking_off"
    FLYING = "flying"
    DESCENDING = "descending"
    LANDING = "landing"

    @property
    def in_flight(self) -> bool:
        """Whether the vehicle is the controller's: what the topic in_flight toggles."""
        return self in _IN_FLIGHT


# Found here once: an enumeration takes its time to look a member up.
_IN_FLIGHT = (FlightState.FLYING, FlightState.DESCENDING)


UNKNOWN = "unknown"
"""What a filter publishes that has not been told a flight state."""

COMMANDED = "commanded"
"""The same, when a controller sends commands: there may be a flight under way."""

SEPARATOR = ": "
"""Between the word that a filter publishes and the reason in plain words, if there is one."""

ORIGIN = " from "
"""Between what a filter has done and the flight state that it heard last."""
