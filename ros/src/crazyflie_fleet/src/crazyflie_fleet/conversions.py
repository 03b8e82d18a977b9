"""Goals and pieces of trajectories as messages, and back."""

import math

import genpy
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3

from crazyflie_driver.msg import FullState, Position, TrajectoryPolynomialPiece
from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_model.polynomials import Goal, PolynomialPiece, at_rest
from crazyflie_msgs.msg import (
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)


def to_message(piece: PolynomialPiece) -> TrajectoryPolynomialPiece:
    """Return a piece for the service upload_trajectory."""
    return TrajectoryPolynomialPiece(*piece.padded_axes, genpy.Duration.from_sec(piece.duration))


def from_message(message: TrajectoryPolynomialPiece) -> PolynomialPiece:
    """Return an uploaded piece."""
    axes = (message.poly_x, message.poly_y, message.poly_z, message.poly_yaw)
    return PolynomialPiece(message.duration.to_sec(), *axes)


def reference_message(
    goal: Goal[float], has_yaw: bool
) -> PositionVelocityYawStateStamped | PositionVelocityStateStamped:
    """Return a controller's reference, without a stamp."""
    if has_yaw:
        state = PositionVelocityYawState(*goal.position, *goal.velocity, goal.yaw)
        return PositionVelocityYawStateStamped(state=state)
    return PositionVelocityStateStamped(state=PositionVelocityState(*goal.position, *goal.velocity))


def full_state_message(goal: Goal[float], frame: str = "world") -> FullState:
    """Return the driver's setpoint in the fixed frame, without a stamp."""
    message = FullState(
        pose=Pose(Point(*goal.position), Quaternion(*quaternion_from_rpy(0.0, 0.0, goal.yaw))),
        twist=Twist(Vector3(*goal.velocity), Vector3(0.0, 0.0, goal.yaw_rate)),
        acc=Vector3(*goal.acceleration),
    )
    message.header.frame_id = frame
    return message


def heading(x: float, y: float, z: float, w: float) -> float:
    """Return the rotation of a quaternion about the vertical, rad: the yaw of a level vehicle."""
    return math.remainder(2.0 * math.atan2(z, w), 2.0 * math.pi)


def setpoint_goal(message: FullState | Position) -> Goal[float]:
    """Return the goal of a setpoint of position."""
    if isinstance(message, Position):
        return at_rest((message.x, message.y, message.z), math.radians(message.yaw))
    p, v, a, q = (
        message.pose.position,
        message.twist.linear,
        message.acc,
        message.pose.orientation,
    )
    return Goal(
        (p.x, p.y, p.z),
        (v.x, v.y, v.z),
        (a.x, a.y, a.z),
        heading(q.x, q.y, q.z, q.w),
        message.twist.angular.z,
    )
