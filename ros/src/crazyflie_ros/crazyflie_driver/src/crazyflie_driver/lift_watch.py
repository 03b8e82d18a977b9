"""Whether a vehicle lifts off when setpoints ask for it.

While the ground holds a vehicle, the firmware's integrators wind up, and it leaps as soon as it is
free. So it does when a position is asked for with another heading than its own. The supervisor's
FLYING does not show it: thrust sets it. A vehicle whose estimate moves may be flying: where motion
capture is frozen, the estimate hardly rises, but its vertical speed, which the accelerometer
drives, is that of the flight.
"""

from typing import NamedTuple

LIMIT = 2.0  #: How long a vehicle may take to lift off, s.
MIN_CLIMB = 0.15  #: Setpoints that are lower above the ground do not ask for a flight, m.
MAX_RISE, MAX_SPEED = 0.05, 0.1  #: A vehicle on the ground estimates no more, m and m/s.
MAX_TURN = 10.0  #: From the heading on the ground to the one that is commanded, degrees.
MAX_GAP = 0.5  #: Setpoints older than this are levelled out by the firmware, s.
PAUSE = 1.0  #: After silence of so long, s, setpoints are a new attempt.


class NoLift(NamedTuple):
    """A vehicle that has not lifted off to a height (m).

    It is certain if its estimate says that it is on the ground, not only that it does not fly.
    """

    height: float
    is_certain: bool


class LiftWatch:
    """Compare the heights that are asked for with the vehicle's estimate; times in s."""

    def __init__(self) -> None:
        self._is_on_ground = False
        self._ground: float | None = None
        self._height = 0.0
        self._latest: float | None = None
        self._begin: float | None = None
        self._is_reported = False

    def end(self) -> None:
        """Take note that there are no setpoints any more."""
        self._begin, self._latest, self._is_reported = None, None, False

    def command(self, now: float, height: float | None) -> bool:
        """Take note of a setpoint that was sent; return whether an attempt to lift off begins.

        Its height is in m, in the frame of the estimate; None if it asks for none.
        """
        if self._latest is not None and now - self._latest > PAUSE:
            self.end()
        self._latest = now
        if height is None or not self._is_on_ground or height - (self._ground or 0.0) < MIN_CLIMB:
            self._begin = None
            return False
        self._height = height
        begins = self._begin is None
        if begins:
            self._begin = now
        return begins

    def sample(
        self, now: float, is_flying: bool | None, height: float | None, speed: float | None
    ) -> NoLift | None:
        """Return what is wrong, once in an attempt; None if nothing is.

        Whether the supervisor reports a flight, the estimate's height (m) and vertical speed (m/s)
        are None while they are not known.
        """
        if self._begin is None and is_flying is False:
            self._is_on_ground, self._ground = True, height
        elif is_flying is None or self._has_left(is_flying, height, speed):
            self._is_on_ground, self._begin = False, None
        if self._begin is None or self._latest is None or self._is_reported:
            return None
        if now - self._begin < LIMIT or now - self._latest > MAX_GAP:
            return None
        self._is_reported = True
        return NoLift(self._height, height is not None and speed is not None)

    def _has_left(self, is_flying, height, speed):
        if height is None or speed is None or self._ground is None:
            return is_flying
        return abs(height - self._ground) > MAX_RISE or abs(speed) > MAX_SPEED
