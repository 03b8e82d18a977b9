"""Whether a vehicle flies, where no takeoff server publishes it."""

import math

LIFTED = 0.05  #: A vehicle so far above the lowest height it has been at flies, m.
LIFTOFF_TIMEOUT = 3.0  #: Longest time from a change of the reference's height to the liftoff, s.


class GroundGuess:
    """A guess whether a vehicle flies: when it is `LIFTED`, or may be about to lift off."""

    def __init__(self) -> None:
        self._lowest = math.inf
        self._goal: float | None = None
        self._moved_at = -math.inf

    def is_flying(self, z: float, goal: float, time: float) -> bool:
        """Return the guess for a height and that of the reference (m) at ``time`` (s)."""
        self._lowest = min(self._lowest, z)
        # After a reset of the clock the timeout begins anew.
        self._moved_at = min(self._moved_at, time)
        if self._goal is None or abs(goal - self._goal) > LIFTED:
            self._goal = goal
            self._moved_at = time
        return z > self._lowest + LIFTED or time - self._moved_at < LIFTOFF_TIMEOUT
