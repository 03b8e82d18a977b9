"""ROS interfaces of the reactions to ranges: following an object, and a filter of cmd_vel."""

import math
from collections.abc import Iterator, Sequence
from functools import partial

from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import Range
from typing_extensions import override

from crazyflie_ranging.reactions import AXES, ObjectFollower, ObstacleStop
from crazyflie_references.velocity_reference import Velocity
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.types import TIME_STEP, ListOf, Text
from crazyflie_utils.vectors import is_finite


class LatestRanges:
    """The latest readings of range sensors, which are valid for ``age`` (s)."""

    def __init__(self, handle: NodeHandle, topics: Sequence[str], age: float):
        self._handle = handle
        self._age = age
        self._readings = [(math.nan, -math.inf)] * len(topics)
        for number, name in enumerate(topics):
            handle.subscribe(name, Range, partial(self._take, number))

    def _take(self, number, message):
        if not math.isnan(message.range):
            self._readings[number] = (message.range, self._handle.time())

    def readings(self) -> list[float | None]:
        """Return the readings in the order of the topics, m; None for a silent sensor."""
        now = self._handle.time()
        return [reading if now - time <= self._age else None for reading, time in self._readings]


class SilenceParameters(Parameters):
    """Times of both nodes: timeout of a sensor, and period of velocities."""

    silence: float = parameter(
        TIME_STEP, "time after the last reading from which a sensor is silent", 0.15
    )
    time_step: float = parameter(TIME_STEP, "period of the velocities", 0.02)

    @override
    def complaints(self) -> Iterator[str]:
        yield from super().complaints()
        if self.time_step >= self.silence:
            yield f"time_step is {self.time_step:g}; expected < silence, {self.silence:g} (s)"

    @property
    def reading_age(self) -> float:
        """Largest age of a valid reading (s): a velocity holds until the next one."""
        return self.silence - self.time_step


class FollowObjectParameters(SilenceParameters, ObjectFollower):
    """Parameters of `FollowObjectNode`."""

    front_topic: str = topic("front", "the sensor in front", "range/front")
    left_topic: str = topic("left", "the sensor at the left", "range/left")
    right_topic: str = topic("right", "the sensor at the right", "range/right")
    cmd_vel_topic: str = topic("cmd_vel", "where velocities go", "cmd_vel")


class FollowObjectNode(Node[FollowObjectParameters]):
    """Keep a distance to the object in front; stand still when the sensor is silent."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.cmd_vel_topic, Twist)
        topics = (parameters.front_topic, parameters.left_topic, parameters.right_topic)
        self._ranges = LatestRanges(handle, topics, parameters.reading_age)
        handle.timer(parameters.time_step, self._on_timer)

    @override
    def enter_safe_state(self) -> None:
        """Stop the vehicle."""
        self._publisher.publish(Twist())

    def _on_timer(self):
        front, left, right = self._ranges.readings()
        if front is None:
            topic = self._handle.resolve(self._parameters.front_topic)
            self._handle.warn(f"standing still: no message on {topic}", throttle=5.0)
            self._publisher.publish(Twist())
            return
        speed, yaw_dot = self._parameters.velocity(front, left, right)
        self._publisher.publish(Twist(linear=Vector3(x=speed), angular=Vector3(z=yaw_dot)))


class ObstacleStopParameters(SilenceParameters, ObstacleStop):
    """Parameters of `ObstacleStopNode`."""

    in_topic: str = topic(
        "cmd_vel_in", "velocities in the heading frame, m/s and rad/s", "cmd_vel_in"
    )
    out_topic: str = topic(
        "cmd_vel_out",
        "the velocities, limited so that the vehicle stops before obstacles",
        "cmd_vel",
    )
    ranges_topic: str = topic("ranges", "namespace of the sensors, one for each direction", "range")
    directions: tuple[str, ...] = parameter(
        ListOf(Text(tuple(AXES))),
        "guarded directions; a silent sensor stops all motion in its direction",
        ("front", "back", "left", "right", "up"),
    )
    command_silence: float = parameter(
        TIME_STEP, "time after the last velocity after which zero is published once", 0.5
    )


class ObstacleStopNode(Node[ObstacleStopParameters]):
    """Pass velocities on, limited so that the vehicle stops before obstacles."""

    def __init__(self) -> None:
        self._command: Velocity | None = None
        self._command_time = 0.0

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.out_topic, Twist)
        topics = [f"{parameters.ranges_topic}/{each}" for each in parameters.directions]
        self._ranges = LatestRanges(handle, topics, parameters.reading_age)
        handle.subscribe(parameters.in_topic, Twist, self._on_cmd_vel)
        handle.timer(parameters.time_step, self._on_timer)

    @override
    def enter_safe_state(self) -> None:
        """Stop the vehicle."""
        self._command = None
        self._publisher.publish(Twist())

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
        # Obstacles also come nearer between two commands.
        if self._command is None:
            return
        if self._handle.time() - self._command_time > self._parameters.command_silence:
            self.enter_safe_state()
        else:
            self._publish(self._command)

    def _publish(self, command):
        directions = self._parameters.directions
        clearances = dict(zip(directions, self._ranges.readings(), strict=True))
        silent = [each for each, clearance in clearances.items() if clearance is None]
        if silent:
            topic = self._handle.resolve(self._parameters.ranges_topic)
            text = f"no motion to {', '.join(silent)}: nothing comes below {topic}"
            self._handle.warn(text, throttle=5.0)
        v = self._parameters.limit(command, clearances)
        self._publisher.publish(Twist(linear=Vector3(v.x, v.y, v.z), angular=Vector3(z=v.yaw_dot)))
