"""ROS interface of following an object: ranges in, cmd_vel out."""

from collections.abc import Iterator

from geometry_msgs.msg import Twist, Vector3
from typing_extensions import override

from crazyflie_ranging.range_topics import LatestRanges
from crazyflie_ranging.reactions import ObjectFollower
from crazyflie_utils import Node, NodeHandle, parameter
from crazyflie_utils.parameters.types import TIME_STEP, TOPIC


class FollowObjectParameters(ObjectFollower):
    """Parameters of `FollowObjectNode`."""

    front_topic: str = parameter(TOPIC, "the sensor in front", "range/front", "topics/front")
    left_topic: str = parameter(TOPIC, "the one at the left", "range/left", "topics/left")
    right_topic: str = parameter(TOPIC, "the one at the right", "range/right", "topics/right")
    cmd_vel_topic: str = parameter(TOPIC, "where velocities go", "cmd_vel", "topics/cmd_vel")
    silence: float = parameter(
        TIME_STEP, "so long after the last reading of the sensor in front it stands still", 0.15
    )
    time_step: float = parameter(TIME_STEP, "between two velocities", 0.02)

    @override
    def complaints(self) -> Iterator[str]:
        yield from super().complaints()
        if self.time_step >= self.silence:
            yield f"time_step is {self.time_step:g}; expected < silence, {self.silence:g} (s)"


class FollowObjectNode(Node):
    """Keep a distance to the object in front; stand still when the sensor is silent."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(FollowObjectParameters, self._reconfigure)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.cmd_vel_topic, Twist)
        self._ranges = LatestRanges(
            handle,
            {
                "front": parameters.front_topic,
                "left": parameters.left_topic,
                "right": parameters.right_topic,
            },
        )
        handle.timer(parameters.time_step, self._on_timer)

    @override
    def enter_safe_state(self) -> None:
        """Stop the vehicle."""
        self._publisher.publish(Twist())

    def _reconfigure(self, parameters):
        self._parameters = parameters

    def _on_timer(self):
        # A velocity holds until the next one.
        age = self._parameters.silence - self._parameters.time_step
        front, left, right = (
            self._ranges.reading(name, age) for name in ("front", "left", "right")
        )
        if front is None:
            topic = self._handle.resolve(self._parameters.front_topic)
            self._handle.warn(f"standing still: nothing comes on {topic}", throttle=5.0)
            self._publisher.publish(Twist())
            return
        speed, yaw_dot = self._parameters.velocity(front, left, right)
        self._publisher.publish(Twist(linear=Vector3(x=speed), angular=Vector3(z=yaw_dot)))
