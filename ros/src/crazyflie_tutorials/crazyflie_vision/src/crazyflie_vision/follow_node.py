"""ROS interface of following: a target in, cmd_vel out."""

import math

from geometry_msgs.msg import PointStamped, Twist, Vector3
from sensor_msgs.msg import CameraInfo
from typing_extensions import override

from crazyflie_references.velocity_reference import Velocity
from crazyflie_utils import Node, NodeHandle, parameter, topic
from crazyflie_utils.parameters.types import TIME_STEP
from crazyflie_vision.follow import TargetFollower
from crazyflie_vision.trackers import Target


class FollowParameters(TargetFollower):
    """Parameters of `FollowNode`."""

    silence: float = parameter(
        TIME_STEP, "time without a target after which the vehicle stops", 0.12, live=True
    )
    time_step: float = parameter(TIME_STEP, "period of the velocities", 0.02)
    target_topic: str = topic("target", "the target: x, y and, as z, radius in pixels", "target")
    info_topic: str = topic("info", "parameters of the camera", "camera/camera_info")
    cmd_vel_topic: str = topic("cmd_vel", "velocities in the heading frame", "cmd_vel")


class FollowNode(Node[FollowParameters]):
    """Publish the velocity that keeps a target in the middle and at a distance.

    Without a target the velocity is zero.
    """

    needed_in_flight = True

    def __init__(self) -> None:
        self._velocity = Velocity()
        self._seen_at = -math.inf
        self._focal_length = 0.0
        self._centre = (0.0, 0.0)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.cmd_vel_topic, Twist)
        handle.subscribe(parameters.info_topic, CameraInfo, self._on_info)
        handle.subscribe(parameters.target_topic, PointStamped, self._on_target, finite="point")
        handle.timer(parameters.time_step, self._on_timer)

    @override
    def enter_safe_state(self) -> None:
        """Stop the vehicle."""
        self._seen_at = -math.inf
        self._publisher.publish(Twist())

    def _on_info(self, message):
        focal_length, _, cx, _, _, cy, *_ = message.K
        if not all(map(math.isfinite, (focal_length, cx, cy))) or focal_length <= 0.0:
            self._handle.warn(
                f"ignoring a camera of focal length {focal_length:g}; expected > 0 (pixels)",
                throttle=5.0,
            )
            return
        self._focal_length, self._centre = focal_length, (cx, cy)

    def _on_target(self, message):
        point = message.point
        if point.z <= 0.0:
            self._handle.warn(
                f"ignoring a target of radius {point.z:g}; expected > 0 (pixels)", throttle=5.0
            )
            return
        if self._focal_length == 0.0:
            topic = self._handle.resolve(self._parameters.info_topic)
            self._handle.warn(f"a target is received, but no message on {topic}", throttle=5.0)
            return
        target = Target(point.x, point.y, point.z)
        self._velocity = self._parameters.velocity(target, self._focal_length, self._centre)
        self._seen_at = self._handle.time()

    def _on_timer(self):
        if self._handle.time() - self._seen_at >= self._parameters.silence:
            self._velocity = Velocity()
        linear = Vector3(self._velocity.x, self._velocity.y, self._velocity.z)
        self._publisher.publish(Twist(linear, Vector3(z=self._velocity.yaw_dot)))
