"""Contact of the feet, which hold a vehicle upright until the rotors tip it over two of them.

The feet are below the motors. With mass m, thrust T and distance d from the centre to the line
through two feet, the weight on the feet turns the body back with the torque (m g - T) d. Rotors
that ask for more tip the body about that line, with the moment of inertia I + m d^2. The body does
not slide, and keeps its heading, while it is tipped.
"""

import math

from crazyflie_model.angles import quaternion_from_zyx, zyx_from_quaternion
from crazyflie_model.elementwise import Vector
from crazyflie_model.quadrotor import Airframe
from crazyflie_model.units import GRAVITY


def tip(
    airframe: Airframe, before: Vector[float], after: Vector[float], dt: float
) -> Vector[float]:
    """Return the state of a vehicle on the ground, with the tilt that its feet allow.

    The states before and after a step of ``dt`` s, 17 components, are those of `Airframe.step`,
    which keeps a vehicle upright that stands.
    """
    parameters = airframe.parameters
    roll, pitch, yaw = zyx_from_quaternion(before[6:10])
    thrust, torque_x, torque_y, _ = airframe.wrench(after[13:17])
    load = parameters.mass * GRAVITY - thrust * math.cos(roll) * math.cos(pitch)
    arm = parameters.arm * math.sqrt(0.5)
    hold = max(load, 0.0) * arm
    edge = parameters.mass * arm * arm
    roll, p = _tipped(roll, before[10], torque_x, hold, parameters.inertia_x + edge, dt)
    pitch, q = _tipped(pitch, before[11], torque_y, hold, parameters.inertia_y + edge, dt)
    if not (roll or pitch):
        return after
    attitude = quaternion_from_zyx(roll, pitch, yaw)
    return [*before[0:2], *after[2:6], *attitude, p, q, *after[12:]]


def _tipped(angle, rate, torque, hold, inertia, dt):
    if angle == 0.0 and abs(torque) <= hold:
        return 0.0, 0.0
    side = math.copysign(1.0, angle or torque)
    rate += (torque - side * hold * math.cos(angle)) / inertia * dt
    tipped = angle + rate * dt
    # Past upright the other feet meet the ground.
    return (tipped, rate) if tipped * side > 0.0 else (0.0, 0.0)
