"""The driver's interface for a vehicle that a controller flies: messages, parameters, calls."""

import math
from concurrent.futures import Future
from typing import Any

from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from std_srvs.srv import Empty, EmptyRequest

from crazyflie_driver import msg
from crazyflie_fleet.follower import Velocity
from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_msgs.msg import (
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import NodeHandle, Parameters, parameter, topic
from crazyflie_utils.flight_status import FlightTopics
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import BOOLEAN, FRAME, SERVICE, TIME_STEP
from crazyflie_utils.vectors import to_tuple


def reference_message(
    goal: Goal[float], has_yaw: bool
) -> PositionVelocityYawStateStamped | PositionVelocityStateStamped:
    """Return a controller's reference, without a stamp."""
    if has_yaw:
        state = PositionVelocityYawState(*goal.position, *goal.velocity, goal.yaw)
        return PositionVelocityYawStateStamped(state=state)
    return PositionVelocityStateStamped(state=PositionVelocityState(*goal.position, *goal.velocity))


def full_state_message(goal: Goal[float], frame: str = "world") -> msg.FullState:
    """Return the driver's setpoint in the fixed frame, without a stamp."""
    message = msg.FullState(
        pose=Pose(Point(*goal.position), Quaternion(*quaternion_from_rpy(0.0, 0.0, goal.yaw))),
        twist=Twist(Vector3(*goal.velocity), Vector3(0.0, 0.0, goal.yaw_rate)),
        acc=Vector3(*goal.acceleration),
    )
    message.header.frame_id = frame
    return message


def heading(x: float, y: float, z: float, w: float) -> float:
    """Return the rotation of a quaternion about the vertical, rad: the yaw of a level vehicle."""
    return math.remainder(2.0 * math.atan2(z, w), 2.0 * math.pi)


def setpoint_of(
    message: msg.FullState | msg.Position | msg.VelocityWorld | msg.Hover,
) -> Goal[float] | Velocity:
    """Return the setpoint of a message, whose yaw rate is clockwise, in deg/s."""
    if isinstance(message, msg.Position):
        return at_rest((message.x, message.y, message.z), math.radians(message.yaw))
    if isinstance(message, msg.VelocityWorld):
        velocity: Any = to_tuple(message.vel)
        return Velocity(velocity, -math.radians(message.yawRate))
    if isinstance(message, msg.Hover):
        ahead, rate = (message.vx, message.vy, 0.0), -math.radians(message.yawrate)
        return Velocity(ahead, rate, message.zDistance)
    pose, twist = message.pose, message.twist
    motion = map(to_tuple, (pose.position, twist.linear, message.acc))
    goal: Any = (*motion, heading(*to_tuple(pose.orientation)), twist.angular.z)
    return Goal(*goal)


#: Namespace, below a vehicle's name, of the node; below /all of the same services for all.
HIGH_LEVEL = "high_level"

COMMAND = "/all/command"  #: Service of a fleet for some of its vehicles.

#: Time from a takeoff until the references of its climb begin, for which the rest is left (s).
TAKEOFF_LEAD = 1.5

#: Names of nodes, separated by spaces, that start their uploaded trajectory 0: vehicles that are
#: called one after the other do not start together.
START_TOPIC = "/all/start_trajectory"


#: In place of a yaw, for `HighLevelNode` only: the vehicle keeps its heading.
KEEP_HEADING = math.nan


class HighLevelParameters(Parameters):
    """Parameters of `HighLevelNode`."""

    reference_topic: str = topic("ref", "references of the controller", "ref")
    has_yaw: bool = parameter(
        BOOLEAN,
        "the controller follows a heading; references are PositionVelocityYawStateStamped, and not "
        "PositionVelocityStateStamped, unless the vehicle is one of a fleet",
        default=False,
        name="reference/yaw",
    )
    state_topic: str = topic("state", "states of the vehicle", "state")
    flight: FlightTopics = group(FlightTopics, "topics")
    takeoff: str = parameter(SERVICE, "the takeoff server's", "takeoff", "srv/takeoff")
    land: str = parameter(SERVICE, "the takeoff server's", "land", "srv/land")
    emergency: str = parameter(SERVICE, "stops the motors", "emergency", "srv/emergency")
    start_topic: str = topic(
        "start", "names of the nodes that start trajectory 0 at once", START_TOPIC
    )
    plan_topic: str = topic("plan", "trajectory that is flown, until its end", "~plan/markers")
    fixed_frame: str = parameter(FRAME, "frame the references are in", "world", "frames/fixed")
    robot_frame: str = parameter(
        FRAME, "frame of the vehicle, which missions read", "crazyflie", "frames/robot"
    )
    time_step: float = parameter(TIME_STEP, "period of the references", 0.02)

    @property
    def reference_type(self) -> type[PositionVelocityStateStamped]:
        """Message type of the references."""
        return PositionVelocityYawStateStamped if self.has_yaw else PositionVelocityStateStamped


_CALL_TIMEOUT = 58.0  #: Timeout of the server's takeoffs and landings (s of the machine's clock).


def relay(handle: NodeHandle, service: str) -> "Future[None]":
    """Call a service of type Empty; return a future that is done when it has answered.

    An error after the future was set otherwise is logged.
    """
    answer: Future[None] = Future()

    def on_done(done):
        error = done.exception()
        if answer.done():
            if error is not None:
                handle.error(str(error))
        elif error is None:
            answer.set_result(None)
        else:
            answer.set_exception(error)

    call = handle.call_service(service, Empty, EmptyRequest(), _CALL_TIMEOUT)
    call.add_done_callback(on_done)
    return answer
