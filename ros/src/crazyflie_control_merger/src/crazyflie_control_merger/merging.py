"""Least-restrictive control: a second controller overrides the first only as far as necessary.

Controls are u = (roll, pitch, yaw_dot, thrust) in rad, rad/s and m/s^2.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crazyflie_model.limits import HOLD_LIMIT

MERGE = "MERGE"
LQR = "LQR"
PRIORITIZED = "PRIORITIZED"
#: Share of the prioritised control in the result: its priority, 0, 1.
MODES = (MERGE, LQR, PRIORITIZED)

ALL_ENTRIES = (0, 1, 2, 3)
NO_YAW_ENTRIES = (0, 1, 3)  #: Entries of the control that the prioritised controller decides on.


class Merger:
    """Mix the latest prioritised control into regular ones.

    A prioritised control is valid for `crazyflie_model.limits.HOLD_LIMIT`. Without one the
    regular control is left as it is, in every mode. ``entries`` are those of the control that are
    mixed; the others stay regular.
    """

    def __init__(self, entries: tuple[int, ...] = ALL_ENTRIES):
        self._entries = list(entries)
        self._prioritized: NDArray[np.float64] = np.zeros(len(entries))
        self._priority = 0.0
        self._time: float | None = None

    def prioritize(self, control: ArrayLike, priority: float, time: float) -> None:
        """Take a prioritised control, shape (len(entries),), at ``time`` (s).

        Priority 0 leaves the regular control alone, 1 replaces it; it is clipped to [0, 1].
        """
        self._prioritized = np.asarray(control, dtype=float)
        self._priority = min(max(priority, 0.0), 1.0)
        self._time = time

    def merged(self, regular: NDArray[np.float64], time: float, mode: str) -> NDArray[np.float64]:
        """Return (1 - p) regular + p prioritised, shape (4,), at ``time`` (s), in a mode."""
        p = self.weight(time, mode)
        if p == 0.0:
            return regular
        merged = regular.copy()
        merged[self._entries] = (1.0 - p) * regular[self._entries] + p * self._prioritized
        return merged

    def weight(self, time: float, mode: str) -> float:
        """Return the share p of the prioritised control at ``time`` (s) in a mode, 0 to 1."""
        # A time that has stepped back belongs to another run.
        if self._time is None or not 0.0 <= time - self._time < HOLD_LIMIT:
            return 0.0
        return {MERGE: self._priority, LQR: 0.0, PRIORITIZED: 1.0}[mode]
