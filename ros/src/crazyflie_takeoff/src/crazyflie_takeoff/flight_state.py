"""States of a flight, as server and filter publish them."""

import enum
from functools import cached_property


class FlightState(enum.IntEnum):
    """State of a flight; the values are those of crazyflie_msgs/FlightStatus.

    A landing has two states, because the vehicle is still in flight in the first: the controller
    brings it down (`DESCENDING`) before the server ramps the thrust down (`LANDING`).
    """

    ON_GROUND = 1
    TAKING_OFF = 2
    FLYING = 3
    DESCENDING = 4
    LANDING = 5

    @property
    def word(self) -> str:
        """The name of the state on text topics."""
        return self.name.lower()

    @cached_property
    def in_flight(self) -> bool:
        """Whether the controller flies the vehicle: the value that the topic in_flight toggles."""
        return self in (FlightState.FLYING, FlightState.DESCENDING)


def flight_state(code: int) -> FlightState | None:
    """Return the state of a constant of FlightStatus; None for UNKNOWN, else ValueError."""
    return FlightState(code) if code else None
