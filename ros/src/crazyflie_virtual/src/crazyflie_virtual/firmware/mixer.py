"""From thrust and outputs about the axes to the commands of four motors."""

FULL_PWM = 65535.0
"""Largest command."""


def mix(thrust: float, roll: float, pitch: float, yaw: float) -> tuple:
    """Return what is asked of motors 1 to 4, PWM, not limited.

    The motors are numbered clockwise from front right; 1 and 3 turn
    counter-clockwise, so that less of them turns the vehicle to the left.

    Parameters
    ----------
    thrust : float
        Of each motor, PWM.
    roll, pitch, yaw : float
        Outputs of the rate controllers, PWM; pitch is positive nose up, yaw
        positive counter-clockwise.
    """
    r, p = roll / 2.0, pitch / 2.0
    return (
        thrust - r + p - yaw,
        thrust - r - p + yaw,
        thrust + r - p - yaw,
        thrust + r + p + yaw,
    )


def limit(requested: tuple, idle: float = 0.0) -> tuple:
    """Return commands that motors can follow.

    Where one exceeds `FULL_PWM` all are lowered alike: attitude comes before
    height.
    """
    excess = max(0.0, max(requested) - FULL_PWM)
    return tuple(max(idle, request - excess) for request in requested)
