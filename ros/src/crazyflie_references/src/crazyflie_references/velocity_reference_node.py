"""ROS interface of the velocity reference: cmd_vel in, references of the controller out."""

from geometry_msgs.msg import Twist
from typing_extensions import override

from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_references.velocity_reference import LimitParameters, Velocity, VelocityReference
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.flight_status import FlightTopics
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import TIME_STEP
from crazyflie_utils.vectors import is_finite, stamped


class VelocityReferenceParameters(Parameters):
    """Parameters of `VelocityReferenceNode`."""

    cmd_vel_topic: str = topic(
        "cmd_vel", "velocities in the heading frame, m/s and rad/s", "cmd_vel"
    )
    reference_topic: str = topic(
        "reference", "references of other nodes, such as the takeoff server's, which are passed on"
    )
    controller_reference_topic: str = topic(
        "controller_reference", "references for the controller go here"
    )
    flight: FlightTopics = group(FlightTopics, "topics")
    time_step: float = parameter(TIME_STEP, "period of the references", 0.02)
    silence: float = parameter(
        TIME_STEP, "time without a velocity after which the vehicle stops", 0.5, live=True
    )
    limits: LimitParameters = group(LimitParameters, "limits")


class VelocityReferenceNode(Node[VelocityReferenceParameters]):
    """Fly a vehicle by velocity: integrate cmd_vel into references while it flies.

    References of other nodes are passed on with the present heading; flight by velocity continues
    from there. So the controller has a single publisher for takeoff, landing and cmd_vel.
    """

    needed_in_flight = True

    def __init__(self) -> None:
        self._flight_state: int = FlightStatus.UNKNOWN
        self._time = 0.0
        self._is_moving = False

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._reference = VelocityReference(parameters.limits, parameters.silence)
        self._publisher = handle.publisher(
            parameters.controller_reference_topic, PositionVelocityYawStateStamped, latch=True
        )
        parameters.flight.subscribe(handle, self._on_flight_status)
        handle.subscribe(
            parameters.reference_topic,
            PositionVelocityStateStamped,
            self._on_reference,
            finite="state",
        )
        handle.subscribe(parameters.cmd_vel_topic, Twist, self._on_cmd_vel)
        self._time = handle.time()
        handle.timer(parameters.time_step, self._on_timer)

    @override
    def enter_safe_state(self) -> None:
        """Publish the present reference at rest."""
        if self._is_moving:
            self._reference.stop()
            self._publish()

    def _reconfigure(self, parameters):
        self._reference.limits = parameters.limits
        self._reference.silence = parameters.silence

    def _on_flight_status(self, status):
        self._flight_state = status.state
        if status.state != FlightStatus.FLYING:
            self._is_moving = False
            self._reference.stop()

    def _on_reference(self, message):
        state = message.state
        self._reference.place(state.x, state.y, state.z)
        self._publish((state.x_dot, state.y_dot, state.z_dot))

    def _on_cmd_vel(self, message):
        linear, angular = message.linear, message.angular
        if not (is_finite(linear) and is_finite(angular)):
            topic = self._handle.resolve(self._parameters.cmd_vel_topic)
            self._handle.warn(f"ignoring a message on {topic}: it is not finite", throttle=1.0)
            return
        self._reference.command(
            Velocity(linear.x, linear.y, linear.z, angular.z), self._handle.time()
        )

    def _on_timer(self):
        now = self._handle.time()
        dt, self._time = max(now - self._time, 0.0), now
        if self._flight_state != FlightStatus.FLYING or self._reference.pose is None:
            return
        if not self._is_moving and not self._reference.is_commanded(now):
            return
        self._reference.advance(dt, now)
        self._publish()
        # At rest and without commands, the node leaves the topic to others.
        self._is_moving = self._reference.is_commanded(now) or any(self._reference.velocity)

    def _publish(self, velocity=None):
        pose = self._reference.pose
        if pose is None:
            return
        velocity = self._reference.velocity if velocity is None else velocity
        state = PositionVelocityYawState(pose.x, pose.y, pose.z, *velocity, pose.yaw)
        stamp = self._handle.stamp()
        self._publisher.publish(stamped(PositionVelocityYawStateStamped, stamp, state=state))
