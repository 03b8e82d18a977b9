"""ROS interface of the obstacle stop: a filter of cmd_vel."""

from collections.abc import Iterator

from geometry_msgs.msg import Twist, Vector3
from typing_extensions import override

from crazyflie_ranging.range_topics import LatestRanges
from crazyflie_ranging.reactions import AXES, ObstacleStop
from crazyflie_references.velocity_reference import Velocity
from crazyflie_utils import Node, NodeHandle, parameter
from crazyflie_utils.parameters.types import TIME_STEP, TOPIC, ListOf, Text
from crazyflie_utils.vectors import is_finite


class ObstacleStopParameters(ObstacleStop):
    """Parameters of `ObstacleStopNode`."""

    in_topic: str = parameter(
        TOPIC, "velocities in the heading frame, m/s and rad/s", "cmd_vel_in", "topics/cmd_vel_in"
    )
    out_topic: str = parameter(
        TOPIC, "the same as far as they lead to no obstacle", "cmd_vel", "topics/cmd_vel_out"
    )
    ranges_topic: str = parameter(
        TOPIC, "below it, each direction has its sensor", "range", name="topics/ranges"
    )
    directions: tuple[str, ...] = parameter(
        ListOf(Text(tuple(AXES))),
        "that are guarded; a silent sensor stops all motion there",
        ("front", "back", "left", "right", "up"),
    )
    silence: float = parameter(TIME_STEP, "so long after its last reading a sensor is silent", 0.15)
    command_silence: float = parameter(
        TIME_STEP, "so long after the last velocity, zero is published once", 0.5
    )
    time_step: float = parameter(TIME_STEP, "between two velocities", 0.02)

    @override
    def complaints(self) -> Iterator[str]:
        if self.time_step >= self.silence:
            yield f"time_step is {self.time_step:g}; expected < silence, {self.silence:g} (s)"


class ObstacleStopNode(Node):
    """Pass velocities on as far as they lead to no obstacle."""

    def __init__(self) -> None:
        self._command: Velocity | None = None
        self._command_time = 0.0

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(ObstacleStopParameters, self._reconfigure)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.out_topic, Twist)
        self._ranges = LatestRanges(
            handle, {each: f"{parameters.ranges_topic}/{each}" for each in parameters.directions}
        )
        handle.subscribe(parameters.in_topic, Twist, self._on_cmd_vel)
        handle.timer(parameters.time_step, self._on_timer)

    @override
    def enter_safe_state(self) -> None:
        """Stop the vehicle."""
        self._command = None
        self._publisher.publish(Twist())

    def _reconfigure(self, parameters):
        self._parameters = parameters

    def _on_cmd_vel(self, message):
        linear, angular = message.linear, message.angular
        if not (is_finite(linear) and is_finite(angular)):
            topic = self._handle.resolve(self._parameters.in_topic)
            self._handle.warn(f"ignoring a message on {topic}: it is not finite", throttle=1.0)
            return
        self._command = Velocity(linear.x, linear.y, linear.z, angular.z)
        self._command_time = self._handle.time()
        self._publish(self._command)

    def _on_timer(self):
        # Obstacles come nearer also between two commands.
        if self._command is None:
            return
        if self._handle.time() - self._command_time > self._parameters.command_silence:
            self.enter_safe_state()
        else:
            self._publish(self._command)

    def _publish(self, command):
        # A velocity holds until the next one.
        age = self._parameters.silence - self._parameters.time_step
        clearances = {each: self._ranges.reading(each, age) for each in self._parameters.directions}
        silent = [each for each, clearance in clearances.items() if clearance is None]
        if silent:
            topic = self._handle.resolve(self._parameters.ranges_topic)
            text = f"no motion to {', '.join(silent)}: nothing comes below {topic}"
            self._handle.warn(text, throttle=5.0)
        v = self._parameters.limit(command, clearances)
        self._publisher.publish(Twist(linear=Vector3(v.x, v.y, v.z), angular=Vector3(z=v.yaw_dot)))
