"""Parts that several nodes share: parameters, goals, and the latest axes of a joystick."""

import math

from genpy import Time
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from sensor_msgs.msg import Joy

from crazyflie_controller.pose_source import WorldFrameParameters
from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_utils import NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC, Integer, Number
from crazyflie_utils.vectors import stamped

AXIS = Integer(0, 255)  #: Number of a joystick's axis.
RATE = Number("Hz", above=0.0, maximum=500.0)  #: Rate of a publisher.


class JoyParameters(Parameters):
    """Parameters of nodes that follow a joystick."""

    joy_topic: str = parameter(TOPIC, "where the joystick's messages come from", "joy")


class SetpointParameters(Parameters):
    """Parameters of nodes that publish cmd_vel."""

    rate: float = parameter(RATE, "rate of setpoints", 50.0)


class GoalParameters(WorldFrameParameters):
    """Parameters of nodes that publish goals."""

    rate: float = parameter(RATE, "rate of goals", 30.0)


def goal_message(stamp: Time, frame: str, x: float, y: float, z: float, yaw: float) -> PoseStamped:
    """Return the message of a goal: position in m and heading in rad, in ``frame``."""
    pose = Pose(Point(x, y, z), Quaternion(*quaternion_from_rpy(0.0, 0.0, yaw)))
    return stamped(PoseStamped, stamp, frame, pose=pose)


#: Age at which the last message of a joystick that repeats its messages expires (s).
JOY_LIMIT = 0.5

REPEATED = "repeated"
"""frame_id, which has no other use, of a Joy whose publisher sends the next one within `JOY_LIMIT`.

Without it silence means that the sticks are held still; with it, that the publisher is stuck, which
a connection does not show.
"""


class JoyAxes:
    """The axes that were received last, as long as their publisher is connected.

    A publisher that repeats its messages (`REPEATED`) must also not be silent.
    """

    def __init__(self, handle: NodeHandle, topic: str):
        self._handle = handle
        self._axes: tuple[float, ...] = ()
        self._expiry = -math.inf
        self._subscriber = handle.subscribe(topic, Joy, self._on_joy)

    def _on_joy(self, message):
        self._axes = tuple(message.axes)
        is_repeated = message.header.frame_id == REPEATED
        self._expiry = self._handle.time() + JOY_LIMIT if is_repeated else math.inf

    def are_alive(self) -> bool:
        """Return whether a joystick is present."""
        if not self._subscriber.has_publishers():
            # The last message is dropped when another publisher comes.
            self._expiry = -math.inf
        return self._handle.time() <= self._expiry

    def axis(self, index: int) -> float:
        """Return an axis, -1 to 1; 0 without this axis, or without a joystick."""
        if not self.are_alive() or index >= len(self._axes):
            return 0.0
        value = self._axes[index]
        return max(-1.0, min(1.0, value)) if math.isfinite(value) else 0.0
