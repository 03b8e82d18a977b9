"""Whether the vehicle flies by the controls of this controller, or by others."""

import math
from collections import deque
from collections.abc import Sequence

from crazyflie_lqr.linear_feedback import U_DIM
from crazyflie_references.governor import Components

#: Difference of roll and pitch (rad), and of thrust (m/s^2), of two controls that are the same.
#: The last node before the vehicle, or a filter of a user's own, may change a control a little.
SAME_TILT, SAME_THRUST = 0.02, 0.2
_TOLERANCES = (SAME_TILT, SAME_TILT, math.inf, SAME_THRUST)  # Yaw has no integral.
_OWN = [None] * U_DIM
#: Longest time on the way to the vehicle, and from one control to the vehicle to the next (s).
MAX_AGE = 0.3
_MEMORY = 32  #: Number of sent controls that are compared.


Channels = Sequence[float | None]  #: Roll, pitch, yaw rate and thrust, each of them or None.


class FlownControl:
    """Compares the controls that go to the vehicle with those that were sent, each number alone.

    Others are flown while the filter holds the vehicle, the geofence pushes it back along an axis,
    or the path to the filter is interrupted. Nothing is known before exactly a sent control was
    flown, as where no node publishes the controls of the vehicle.
    """

    def __init__(self) -> None:
        self._sent: deque[tuple[float, Components]] = deque(maxlen=_MEMORY)
        self.forget()

    def forget(self) -> None:
        """Know nothing, as before a flight."""
        self._sent.clear()
        self._flown: Components | None = None  # None while nothing is known.
        self._others: Channels | None = None
        self._time = -math.inf

    def send(self, u: Components, time: float) -> None:
        """Record a control that is sent at ``time`` (s)."""
        self._sent.append((time, u))

    def receive(self, u: Components, time: float) -> None:
        """Record a control that went to the vehicle at ``time`` (s)."""
        exact = self._flown is None
        others: Channels = list(u)
        for at, own in reversed(self._sent):
            if time - at > MAX_AGE or others == _OWN:
                break
            others = [
                None if value is None or _is_same(value, own[k], k, exact) else value
                for k, value in enumerate(others)
            ]
        self._others = None if others == _OWN else others
        if self._others is None or not exact:
            self._flown, self._time = u, time

    def foreign(self, time: float) -> Channels | None:
        """Return what is flown at ``time`` (s) in place of what is sent; None where nothing is."""
        is_known = 0.0 <= time - self._time <= MAX_AGE
        return self._others if is_known else self._flown


def _is_same(value, own, channel, exact):
    difference = abs(value - own)
    return difference == 0.0 or (not exact and difference <= _TOLERANCES[channel])
