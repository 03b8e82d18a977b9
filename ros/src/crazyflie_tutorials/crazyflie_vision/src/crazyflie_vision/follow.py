"""Following a target, which is kept in the middle of a camera's image, and at a distance."""

import math

from crazyflie_references.velocity_reference import Velocity, clamp
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import Number
from crazyflie_vision.trackers import Target

_LENGTH = Number("m", above=0.0)
_GAIN = Number("1/s", minimum=0.0)
_SPEED = Number("m/s", minimum=0.0)


class GainParameters(Parameters):
    """Gains from errors to velocities."""

    forward: float = parameter(
        _GAIN, "velocity ahead over the error of the distance", 1.5, live=True
    )
    up: float = parameter(_GAIN, "velocity upwards over the error of the height", 1.5, live=True)
    turn: float = parameter(_GAIN, "yaw rate over the angle to the target", 2.5, live=True)


class SpeedParameters(Parameters):
    """Limits of the velocities."""

    forward: float = parameter(_SPEED, "largest velocity ahead and back", 0.5, live=True)
    up: float = parameter(_SPEED, "largest velocity up and down", 0.3, live=True)
    turn: float = parameter(
        Number("rad/s", minimum=0.0), "largest yaw rate to either side", 1.0, live=True
    )


class TargetFollower(Parameters):
    """A proportional controller from a target in an image to a velocity."""

    distance: float = parameter(_LENGTH, "distance to the target", 1.0, live=True)
    radius: float = parameter(
        _LENGTH, "radius of the target; half the width of a face", 0.12, live=True
    )
    gains: GainParameters = group(GainParameters, "gains")
    limits: SpeedParameters = group(SpeedParameters, "limits")

    def velocity(
        self, target: Target, focal_length: float, centre: tuple[float, float]
    ) -> Velocity:
        """Return the velocity, in the heading frame, towards the place before a target.

        The depth follows from the target's radius (> 0), since radius / depth is the same in the
        image as in the world. Focal length and ``centre``, the place of the optical axis (cx, cy),
        are those of a camera that looks ahead, pixels.
        """
        gains, limits = self.gains, self.limits
        depth = focal_length * self.radius / target.radius
        right = (target.x - centre[0]) / focal_length
        down = (target.y - centre[1]) / focal_length
        return Velocity(
            x=clamp(gains.forward * (depth - self.distance), limits.forward),
            z=clamp(-gains.up * depth * down, limits.up),
            yaw_dot=clamp(-gains.turn * math.atan(right), limits.turn),
        )
