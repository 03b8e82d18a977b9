"""Axes of a joystick, or of keys in its place, to velocities."""

from collections.abc import Sequence
from dataclasses import dataclass

from crazyflie_references.velocity_reference import Velocity


@dataclass(frozen=True)
class Axes:
    """Numbers of the axes, from 0, and the velocities of a full deflection.

    Attributes
    ----------
    forward, left, up, turn : int
        Which axis it is.
    horizontal, vertical : float
        m/s.
    yaw_dot : float
        rad/s.
    """

    forward: int
    left: int
    up: int
    turn: int
    horizontal: float
    vertical: float
    yaw_dot: float

    def velocity(self, deflections: Sequence[float]) -> Velocity:
        """Return the velocity for deflections from -1 to 1; an axis that is missing is at 0."""

        def deflection(axis):
            value = deflections[axis] if axis < len(deflections) else 0.0
            return min(max(value, -1.0), 1.0)

        return Velocity(
            self.horizontal * deflection(self.forward),
            self.horizontal * deflection(self.left),
            self.vertical * deflection(self.up),
            self.yaw_dot * deflection(self.turn),
        )
