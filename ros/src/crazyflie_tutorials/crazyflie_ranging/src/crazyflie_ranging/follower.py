"""A velocity that follows an object, from the distance to it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class FollowDistances:
    """What is done at which distance (m): see `Follower`."""

    back_off: float
    follow: float
    lost: float


@dataclass(frozen=True)
class Follower:
    """Follows what is in front: at full speed ahead or back, or not at all.

    Nearer than ``back_off`` it backs off; beyond ``follow``, up to ``lost``, it follows; else it
    stands still. What is not in front, but up to ``lost`` away at one side only, it turns to.

    Attributes
    ----------
    distances : FollowDistances
    scale_linear : float
        Speed ahead and back, m/s.
    scale_angular : float
        Yaw rate, rad/s; 0: it never turns.
    """

    distances: FollowDistances
    scale_linear: float
    scale_angular: float

    def velocity(
        self, front: float, left: float | None = None, right: float | None = None
    ) -> tuple[float, float]:
        """Return the velocity ahead (m/s) and the yaw rate (rad/s, counter-clockwise).

        Parameters
        ----------
        front, left, right : float or None
            Distances, m; infinite where nothing is, None where no sensor speaks.
        """
        distances = self.distances
        if front < distances.back_off:
            return -self.scale_linear, 0.0
        if front <= distances.follow:
            return 0.0, 0.0
        if front <= distances.lost:
            return self.scale_linear, 0.0
        is_left = left is not None and left <= distances.lost
        is_right = right is not None and right <= distances.lost
        return 0.0, self.scale_angular * (is_left - is_right)
