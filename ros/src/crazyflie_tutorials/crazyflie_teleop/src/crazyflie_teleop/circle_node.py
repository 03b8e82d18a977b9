"""ROS interface of the circle: a publisher on cmd_vel, nothing else."""

from geometry_msgs.msg import Twist, Vector3
from typing_extensions import override

from crazyflie_teleop.circle import circle_velocity
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import BOOLEAN, TIME_STEP, TOPIC, Number


class CircleParameters(Parameters):
    """Parameters of `CircleNode`."""

    cmd_vel_topic: str = parameter(TOPIC, "where velocities go", "cmd_vel", "topics/cmd_vel")
    time_step: float = parameter(TIME_STEP, "between two velocities", 0.1)
    radius: float = parameter(Number("m", above=0.0), "of the circle", 0.5, live=True)
    speed: float = parameter(Number("m/s", above=0.0), "along the circle", 0.3, live=True)
    clockwise: bool = parameter(BOOLEAN, "direction, as seen from above", True, live=True)


class CircleNode(Node):
    """Publish the velocity of a circle, over and over."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._reconfigure(handle.load(CircleParameters, self._reconfigure))

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher(self._parameters.cmd_vel_topic, Twist)
        handle.timer(self._parameters.time_step, self._on_timer)

    @override
    def enter_safe_state(self) -> None:
        """Stop the vehicle."""
        self._publisher.publish(Twist())

    def _reconfigure(self, parameters):
        self._parameters = parameters
        velocity = circle_velocity(parameters.radius, parameters.speed, parameters.clockwise)
        self._twist = Twist(linear=Vector3(x=velocity.x), angular=Vector3(z=velocity.yaw_dot))

    def _on_timer(self):
        self._publisher.publish(self._twist)
