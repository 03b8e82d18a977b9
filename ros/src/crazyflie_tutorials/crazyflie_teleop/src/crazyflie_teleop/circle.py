"""The velocity with which a vehicle flies a circle."""

from crazyflie_references.velocity_reference import Velocity


def circle_velocity(radius: float, speed: float, clockwise: bool) -> Velocity:
    """Return the velocity, in the heading frame, of a vehicle that looks along its circle.

    The yaw rate is v / r; as seen from above, a clockwise turn has a negative one.

    Parameters
    ----------
    radius : float
        m.
    speed : float
        m/s.
    clockwise : bool
    """
    yaw_dot = speed / radius
    return Velocity(x=speed, yaw_dot=-yaw_dot if clockwise else yaw_dot)
