"""In what modes the filter is, and how long it waits in them."""

import enum
from dataclasses import dataclass

SHORTEST_HOLD = 0.03
"""A control younger than this, s, is never late: three periods of a controller at 100 Hz."""


class Mode(enum.Enum):
    """Who has the vehicle.

    PASSING: who publishes controls. HOLDING and SINKING: the filter, until
    the controller comes back or for good. DOWN: nobody until the next takeoff. EMERGENCY: nobody
    until the filter is reset.
    """

    PASSING = enum.auto()
    HOLDING = enum.auto()
    SINKING = enum.auto()
    DOWN = enum.auto()
    EMERGENCY = enum.auto()

    @property
    def is_final(self) -> bool:
        """Whether controls are not passed on any more."""
        return self in (Mode.SINKING, Mode.DOWN, Mode.EMERGENCY)


@dataclass(frozen=True)
class Patience:
    """How long a filter waits.

    Attributes
    ----------
    hold : float
        For a control in flight, before it takes over, s; at least `SHORTEST_HOLD`.
    recovery : float
        For the control to come back, before the descent begins, s: while no state comes, either,
        and when nothing is to be gone on with but a takeoff or a landing.
    descent : float
        For the touchdown, before it stops the motors, s; and while the height is known, as
        much longer as the way down takes.
    place : float
        The same as ``recovery`` for a vehicle in flight whose state is known, s.
    """

    hold: float
    recovery: float
    descent: float
    place: float = 3.0
