"""Whether the control is flown, as far as a controller can know."""

import math

LIFTED = 0.05
"""A vehicle so far above the lowest height it has been at flies, m."""

PATIENCE = 3.0
"""How long after a reference has moved a vehicle that nobody says anything about may take to
lift off, s."""


class GroundGuess:
    """A guess whether a vehicle stands on the ground, where no takeoff server tells.

    It flies when it is `LIFTED`; and for `PATIENCE` after the reference moved: it may
    be about to lift off.
    """

    def __init__(self) -> None:
        self._lowest = math.inf
        self._goal: float | None = None
        self._moved_at = -math.inf

    def is_flying(self, z: float, goal: float, time: float) -> bool:
        """Tell whether it flies, at height and goal (m) and ``time`` (s)."""
        self._lowest = min(self._lowest, z)
        # After a reset of the clock the patience begins anew.
        self._moved_at = min(self._moved_at, time)
        if self._goal is None or abs(goal - self._goal) > LIFTED:
            self._goal = goal
            self._moved_at = time
        return z > self._lowest + LIFTED or time - self._moved_at < PATIENCE
