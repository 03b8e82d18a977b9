"""The ground: where the vehicle took off, and whether it rests on any."""

from crazyflie_takeoff.motion import Motion

TOUCHDOWN_HEIGHT = 0.05  #: A vehicle less than this above where it took off may be down, m.
ON_GROUND_HEIGHT = 0.1  #: A vehicle less than this above the ground has not been flown, m.
TOUCHDOWN_SPEED = 0.1  #: A vehicle that sinks slower than this although it is to sink is down, m/s.

#: No vehicle stays in the air with less thrust than this, as a fraction of that of hover: it
#: passes through speeds below `TOUCHDOWN_SPEED` within 0.1 s.
SINKING_THRUST = 0.75
REST_TIME = 0.3  #: How long a vehicle has to stay where it is with so little thrust, s.


class Ground:
    """The ground from which the vehicle took off, and the one on which it comes to rest.

    The former is where it was when the server last sent zero thrust. The latter may be lower, as
    beside a table, or higher; so what has flown is down where it stays without enough thrust.
    """

    def __init__(self) -> None:
        self.z = 0.0  # Of the place of the takeoff, m, fixed frame.
        self._has_flown = False
        self._rest = 0.0

    def measure(self, motion: Motion, is_on_ground: bool, in_flight: bool) -> None:
        """Take a measured state, with what the server says of the vehicle."""
        if is_on_ground:
            self.z, self._has_flown = motion.position[2], False
        elif in_flight or not self.is_below(motion):
            self._has_flown = True

    def begin_descent(self) -> None:
        """Forget where the vehicle rested before."""
        self._rest = 0.0

    def height(self, motion: Motion) -> float:
        """Return the height of a vehicle above the place of the takeoff, m."""
        return motion.position[2] - self.z

    def advance(self, step: float, motion: Motion | None, thrust: float) -> None:
        """Let time pass (s) with a thrust, as a fraction of that of hover."""
        rests = motion is not None and abs(motion.velocity[2]) < TOUCHDOWN_SPEED
        self._rest = self._rest + step if rests and thrust < SINKING_THRUST else 0.0

    def has_touched_down(self, motion: Motion | None) -> bool:
        """Whether a vehicle that is to sink is down; not if its state is not known."""
        if motion is None or is_sinking(motion):
            return False
        is_low = self.height(motion) < TOUCHDOWN_HEIGHT
        return self._rest > REST_TIME or (is_low and not self._has_flown)

    def is_below(self, motion: Motion | None) -> bool:
        """Whether a vehicle is on the ground; not if its state is not known."""
        return motion is not None and self.height(motion) < ON_GROUND_HEIGHT


def is_sinking(motion: Motion) -> bool:
    """Return whether a vehicle sinks with at least `TOUCHDOWN_SPEED`."""
    return motion.velocity[2] <= -TOUCHDOWN_SPEED
