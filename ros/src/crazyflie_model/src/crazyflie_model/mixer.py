"""From thrust and outputs about the axes to the commands of four motors.

The motors are numbered as on the Crazyflie, seen from above: 1 front right, 2 back right,
3 back left, 4 front left; 1 and 3 turn counter-clockwise, 2 and 4 clockwise, so that less of
1 and 3 turns the vehicle to the left.
"""

import math
from collections.abc import Sequence

from crazyflie_model.elementwise import Number, Vector, clip, where
from crazyflie_model.limits import FULL_PWM


def mix(thrust: Number, about_x: Number, about_y: Number, about_z: Number) -> Vector[Number]:
    """Return the requests to motors 1 to 4, PWM, not limited.

    From the thrust of each motor and the outputs of the rate controllers about forward, left and
    up, PWM.
    """
    x, y, z = about_x / 2.0, about_y / 2.0, about_z
    return [
        thrust - x - y - z,
        thrust - x + y + z,
        thrust + x + y - z,
        thrust + x - y + z,
    ]


def limit(requested: Sequence[Number], idle: float = 0.0) -> Vector[Number]:
    """Return commands from ``idle`` to `FULL_PWM` for four requested ones, PWM.

    Where one would exceed `FULL_PWM`, all are lowered alike: attitude comes before height.
    """
    highest = requested[0]
    for request in requested[1:]:
        highest = where(request > highest, request, highest)
    excess = clip(highest - FULL_PWM, 0.0, math.inf)
    return [clip(request - excess, idle, FULL_PWM) for request in requested]
