"""Following what a camera sees: it stays in the middle of the image, and at a distance."""

import math
from dataclasses import dataclass

from crazyflie_references.velocity_reference import Velocity
from crazyflie_vision.target import Target


@dataclass(frozen=True)
class Follower:
    """A proportional controller from a target in an image to a velocity.

    Attributes
    ----------
    distance : float
        To be kept between camera and target, m.
    radius : float
        Of the target in the world, m.
    forward, up, turn : float
        Gains: velocity over distance and over height, rate over angle, 1/s.
    max_forward, max_up : float
        m/s.
    max_turn : float
        rad/s.
    """

    distance: float
    radius: float
    forward: float
    up: float
    turn: float
    max_forward: float
    max_up: float
    max_turn: float

    def velocity(
        self, target: Target, focal_length: float, centre: tuple[float, float]
    ) -> Velocity:
        """Return the velocity that brings a target to its place.

        How far away it is follows from its size, since radius / depth is the same in the
        image as in the world.

        Parameters
        ----------
        target : Target
            Its radius is > 0.
        focal_length : float
            Of the camera, pixels.
        centre : tuple of float
            Where the optical axis is in the image: cx, cy, pixels.

        Returns
        -------
        Velocity
            In the heading frame of a vehicle whose camera looks ahead.
        """
        depth = focal_length * self.radius / target.radius
        right = (target.x - centre[0]) / focal_length
        down = (target.y - centre[1]) / focal_length
        return Velocity(
            x=_limited(self.forward * (depth - self.distance), self.max_forward),
            z=_limited(-self.up * depth * down, self.max_up),
            yaw_dot=_limited(-self.turn * math.atan(right), self.max_turn),
        )


def _limited(value, limit):
    return min(max(value, -limit), limit)
