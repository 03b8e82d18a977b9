"""Height of the ground, and how close to it a vehicle is."""

from crazyflie_takeoff.motion import Motion

TOUCHDOWN_HEIGHT = 0.05  #: A vehicle less than this above the ground counts as down, m.
ON_GROUND_HEIGHT = 0.1  #: A vehicle less than this above the ground has not been flown, m.
TOUCHDOWN_SPEED = 0.1  #: A vehicle near the ground that sinks slower than this has met it, m/s.


class Ground:
    """The ground below the vehicle: where it was when the server last sent zero thrust."""

    def __init__(self) -> None:
        self.z = 0.0  # m, fixed frame.

    def height(self, motion: Motion) -> float:
        """Return the height of a vehicle above the ground, m."""
        return motion.position[2] - self.z

    def has_touched_down(self, motion: Motion | None) -> bool:
        """Whether a vehicle that sinks has met the ground; not if its state is not known."""
        is_low = motion is not None and self.height(motion) < TOUCHDOWN_HEIGHT
        return motion is not None and is_low and motion.velocity[2] > -TOUCHDOWN_SPEED

    def is_below(self, motion: Motion | None) -> bool:
        """Whether a vehicle is on the ground; not if its state is not known."""
        return motion is not None and self.height(motion) < ON_GROUND_HEIGHT
