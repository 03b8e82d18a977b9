"""The states of a flight, and the phases of the supervisor."""

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


class FilterState(enum.IntEnum):
    """What others are told of a phase; the values are those of crazyflie_msgs/FilterStatus."""

    PASSING = 0
    HOLDING = 1
    SINKING = 2
    DOWN = 3
    EMERGENCY = 4


class Phase(enum.Enum):
    """Phase of the supervisor: which control it sends.

    `Phase.follows` are the phases in which the server and the controller fly the vehicle.
    """

    # Nothing has shown yet what the vehicle does: commanded controls pass in a known flight only.
    LISTENING = 1, FilterState.PASSING
    # Takeoff controls pass.
    ON_GROUND = 2, FilterState.PASSING
    # Takeoff controls pass, and commanded controls when the vehicle needs the controller.
    PASSING = 3, FilterState.PASSING
    # Commanded controls pass, mixed with the supervisor's own for `RETURN_TIME`.
    RETURNING = 4, FilterState.PASSING
    # The supervisor keeps the vehicle in place until a control comes back.
    HOLDING = 5, FilterState.HOLDING
    # It brings the vehicle down, whatever comes.
    SINKING = 6, FilterState.SINKING
    # Motors off until the next takeoff.
    DOWN = 7, FilterState.DOWN
    # Motors off until a reset.
    EMERGENCY = 8, FilterState.EMERGENCY

    def __init__(self, _: int, state: FilterState):
        self.state = state  #: What others are told.
        self.follows = state is FilterState.PASSING  #: Whether controls pass.
        self.is_off = state >= FilterState.DOWN  #: Whether the motors are kept off.
