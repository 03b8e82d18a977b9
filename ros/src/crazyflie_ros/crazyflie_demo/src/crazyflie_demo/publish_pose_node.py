"""ROS interface of a constant goal, and of one that a joystick moves."""

from geometry_msgs.msg import PoseStamped
from typing_extensions import TypeVar, override

from crazyflie_demo.joystick import PITCH, ROLL, THRUST, YAW
from crazyflie_demo.node_parts import AXIS, GoalParameters, JoyAxes, JoyParameters, goal_message
from crazyflie_utils import Node, NodeHandle, parameter
from crazyflie_utils.parameters.types import METRES, TOPIC, Number

_SPEED = Number("m/s", minimum=0.0)


class PublishPoseParameters(GoalParameters):
    """Parameters of `PublishPoseNode`."""

    topic: str = parameter(TOPIC, "where goals go", "goal", "name")
    x: float = parameter(METRES, "initial position of the goal")
    y: float = parameter(METRES, "initial position of the goal")
    z: float = parameter(METRES, "initial position of the goal")
    yaw: float = parameter(Number("rad"), "initial heading of the goal", 0.0)


class PublishPoseTeleopParameters(PublishPoseParameters, JoyParameters):
    """Parameters of `PublishPoseTeleopNode`."""

    x_axis: int = parameter(AXIS, "number of the joystick's axis", PITCH, "axes/x")
    y_axis: int = parameter(AXIS, "number of the joystick's axis", ROLL, "axes/y")
    z_axis: int = parameter(AXIS, "number of the joystick's axis", THRUST, "axes/z")
    yaw_axis: int = parameter(AXIS, "number of the joystick's axis", YAW, "axes/yaw")
    x_speed: float = parameter(_SPEED, "value at full deflection", 0.5, "speed/x", live=True)
    y_speed: float = parameter(_SPEED, "value at full deflection", 0.5, "speed/y", live=True)
    z_speed: float = parameter(_SPEED, "value at full deflection", 0.3, "speed/z", live=True)
    yaw_speed: float = parameter(
        Number("rad/s", minimum=0.0), "value at full deflection", 1.0, "speed/yaw", live=True
    )

    @property
    def axes(self) -> tuple[tuple[int, float], ...]:
        """Axis and speed (m/s, rad/s) at full deflection, for x, y, z and yaw."""
        return (
            (self.x_axis, self.x_speed),
            (self.y_axis, self.y_speed),
            (self.z_axis, self.z_speed),
            (self.yaw_axis, self.yaw_speed),
        )


G = TypeVar("G", bound=PublishPoseParameters, default=PublishPoseParameters)


class PublishPoseNode(Node[G]):
    """Publish the same goal again and again."""

    parameters_type = PublishPoseParameters

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._goal = [parameters.x, parameters.y, parameters.z, parameters.yaw]
        self._publisher = handle.publisher(parameters.topic, PoseStamped)
        handle.timer(1.0 / parameters.rate, self._on_timer)

    def _on_timer(self):
        stamp, frame = self._handle.stamp(), self._parameters.world_frame
        self._publisher.publish(goal_message(stamp, frame, *self._goal))


class PublishPoseTeleopNode(PublishPoseNode[PublishPoseTeleopParameters]):
    """Publish a goal that moves as the sticks are tilted, and stays without a joystick."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._moved = handle.time()
        self._axes = JoyAxes(handle, self._parameters.joy_topic)
        super().register_callbacks(handle)

    @override
    def _on_timer(self):
        now = self._handle.time()
        parameters = self._parameters
        # After a pause, or a reset of the clock, the goal does not jump.
        elapsed = min(max(now - self._moved, 0.0), 2.0 * (1.0 / parameters.rate))
        self._moved = now
        self._goal = [
            value + speed * self._axes.axis(axis) * elapsed
            for value, (axis, speed) in zip(self._goal, parameters.axes, strict=True)
        ]
        super()._on_timer()
