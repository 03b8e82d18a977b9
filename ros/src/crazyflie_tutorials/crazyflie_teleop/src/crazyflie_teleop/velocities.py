"""Velocities in the heading frame: of a circle, and of the axes of a joystick."""

from collections.abc import Sequence

from crazyflie_references.velocity_reference import Velocity
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import Integer, Number


def circle_velocity(radius: float, speed: float, clockwise: bool) -> Velocity:
    """Return the velocity, in the heading frame, of a vehicle that looks along its circle.

    The yaw rate is speed (m/s) over radius (m), negative for a turn that is clockwise as seen from
    above.
    """
    yaw_dot = speed / radius
    return Velocity(x=speed, yaw_dot=-yaw_dot if clockwise else yaw_dot)


AXIS_NUMBER = Integer(0, 63)  #: Number of an axis or a button of sensor_msgs/Joy.


class AxisParameters(Parameters):
    """Numbers of axes, from 0, as on gamepads and crazyflie_demo's keyboard."""

    forward: int = parameter(AXIS_NUMBER, "flies ahead", 4)
    left: int = parameter(AXIS_NUMBER, "axis of the velocity to the left", 3)
    up: int = parameter(AXIS_NUMBER, "rises", 1)
    turn: int = parameter(AXIS_NUMBER, "axis of the yaw rate to the left", 0)


class JoyVelocity(Parameters):
    """Velocities of a joystick's full deflections."""

    axes: AxisParameters = group(AxisParameters, "axes")
    horizontal: float = parameter(
        Number("m/s", above=0.0), "speed at full deflection", 0.5, "speed/horizontal", live=True
    )
    vertical: float = parameter(
        Number("m/s", above=0.0), "speed at full deflection", 0.3, "speed/vertical", live=True
    )
    yaw_dot: float = parameter(
        Number("rad/s", above=0.0), "yaw rate at full deflection", 1.0, "speed/yaw_dot", live=True
    )

    def velocity(self, deflections: Sequence[float]) -> Velocity:
        """Return the velocity for deflections from -1 to 1; an axis that is missing is at 0."""

        def deflection(axis):
            value = deflections[axis] if axis < len(deflections) else 0.0
            return min(max(value, -1.0), 1.0)

        return Velocity(
            self.horizontal * deflection(self.axes.forward),
            self.horizontal * deflection(self.axes.left),
            self.vertical * deflection(self.axes.up),
            self.yaw_dot * deflection(self.axes.turn),
        )
