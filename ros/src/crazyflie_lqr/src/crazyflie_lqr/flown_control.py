"""Whether the vehicle flies by the controls of this controller, or by others."""

from collections import deque

from crazyflie_lqr.linear_feedback import PITCH, ROLL, THRUST
from crazyflie_references.governor import Components

#: Difference of roll and pitch (rad), and of thrust (m/s^2), of two controls that are the same.
#: The last node before the vehicle, or a filter of a user's own, may change a control a little.
SAME_TILT, SAME_THRUST = 0.02, 0.2
#: Longest time on the way to the vehicle, and from one control to the vehicle to the next (s).
MAX_AGE = 0.3
_MEMORY = 32  #: Number of sent controls that are compared.


class FlownControl:
    """Compares the controls that go to the vehicle with those that were sent.

    Other controls are flown while the filter holds the vehicle, the geofence pushes it back, or the
    path to the filter is interrupted. Nothing is known before exactly a sent control was flown, as
    where no node publishes the controls of the vehicle.
    """

    def __init__(self) -> None:
        self._sent: deque[tuple[float, Components]] = deque(maxlen=_MEMORY)
        self._flown: Components | None = None  # None while nothing is known.
        self._is_own = False
        self._time = 0.0

    def forget(self) -> None:
        """Know nothing, as before a flight."""
        self._sent.clear()
        self._flown, self._is_own = None, False

    def send(self, u: Components, time: float) -> None:
        """Record a control that is sent at ``time`` (s)."""
        self._sent.append((time, u))

    def receive(self, u: Components, time: float) -> None:
        """Record a control that went to the vehicle at ``time`` (s)."""
        tolerance = 0.0 if self._flown is None else 1.0
        self._is_own = any(
            time - sent <= MAX_AGE and _is_same(u, own, tolerance)
            for sent, own in reversed(self._sent)
        )
        if self._is_own or self._flown is not None:
            self._flown, self._time = u, time

    def foreign(self, time: float) -> Components | None:
        """Return what is flown at ``time`` (s) in place of the controls that are sent, or None."""
        is_own = self._is_own and 0.0 <= time - self._time <= MAX_AGE
        return None if is_own else self._flown


def _is_same(a, b, tolerance):
    return (
        abs(a[THRUST] - b[THRUST]) <= tolerance * SAME_THRUST
        and abs(a[ROLL] - b[ROLL]) <= tolerance * SAME_TILT
        and abs(a[PITCH] - b[PITCH]) <= tolerance * SAME_TILT
    )
