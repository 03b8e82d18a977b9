"""Topics of a bag: series of numbers of a vehicle, and events.

The topics are those of the examples, of the C++ workspace and of crazyflie_ros.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_model.units import thrust_from_pwm
from crazyflie_reports.bag_file import Connection
from crazyflie_reports.flight_record import CONTROL_FIELDS, STATE_FIELDS

POSE_FIELDS = ("x", "y", "z", "roll", "pitch", "yaw")

Row = Sequence[float]


@dataclass(frozen=True)
class Role:
    """A series of numbers of a vehicle, from topics of certain names and types."""

    name: str
    #: Regular expression of the name below the vehicle's namespace, or before its name.
    topics: str
    fields: tuple[str, ...]  #: Fields of a row.
    rows: dict[str, Callable[[Any], Row]]  #: Type -> function that returns the row of a message.


def pose_row(pose: Any) -> Row:
    """Return `POSE_FIELDS` (m, rad) of a geometry_msgs/Pose."""
    return placed(pose.position, pose.orientation)


def placed(p: Any, q: Any) -> Row:
    """Return `POSE_FIELDS` (m, rad) of a position and a quaternion with x, y, z (and w)."""
    return (p.x, p.y, p.z, *rpy_from_quaternion(q.x, q.y, q.z, q.w))


def _of_cmd_vel(twist):
    return (
        math.radians(twist.linear.y),
        math.radians(twist.linear.x),
        -math.radians(twist.angular.z),
        thrust_from_pwm(twist.linear.z),
    )


def _at_rest(x, y, z, yaw):
    return (x, y, z, 0.0, 0.0, 0.0, yaw)


def _of_full_state(message):
    velocity = message.twist.linear
    *position, _, _, yaw = pose_row(message.pose)
    return (*position, velocity.x, velocity.y, velocity.z, yaw)


def _at_rest_at_pose(message):
    x, y, z, _, _, yaw = pose_row(message.pose)
    return _at_rest(x, y, z, yaw)


def _of_position(message):
    # The yaw is in degrees.
    return _at_rest(message.x, message.y, message.z, math.radians(message.yaw))


def _numbers(field, names):
    return attrgetter(*(f"{field}.{name}" for name in names))


_position_velocity = _numbers("state", STATE_FIELDS[:6])

_STATES: dict[str, Callable[[Any], Row]] = {
    "crazyflie_msgs/PositionVelocityYawStateStamped": _numbers("state", STATE_FIELDS),
    "crazyflie_msgs/PositionVelocityStateStamped": lambda m: (*_position_velocity(m), math.nan),
    "crazyflie_msgs/FullStateStamped": _numbers("state", STATE_FIELDS),
}
_CONTROLS: dict[str, Callable[[Any], Row]] = {
    "crazyflie_msgs/ControlStamped": _numbers("control", CONTROL_FIELDS)
}
_POSES: dict[str, Callable[[Any], Row]] = {
    "geometry_msgs/PoseStamped": lambda message: pose_row(message.pose)
}
_STATUS: dict[str, Callable[[Any], Row]] = {
    "crazyflie_interfaces/Status": lambda message: (message.battery_voltage,)
}

#: The types of crazyflie_interfaces, and cmd_vel_legacy, are those of crazyswarm2, in ROS 2.
ROLES = (
    Role("state", "state", STATE_FIELDS, _STATES),
    Role("reference", "ref|ref/position_velocity_yaw", STATE_FIELDS, _STATES),
    Role(
        "reference",
        "goal|cmd_full_state|cmd_position",
        STATE_FIELDS,
        {
            "geometry_msgs/PoseStamped": _at_rest_at_pose,
            "crazyflie_driver/FullState": _of_full_state,
            "crazyflie_driver/Position": _of_position,
            "crazyflie_interfaces/FullState": _of_full_state,
            "crazyflie_interfaces/Position": _of_position,
        },
    ),
    Role("final_control", "control/final", CONTROL_FIELDS, _CONTROLS),
    Role("cmd_vel", "cmd_vel|cmd_vel_legacy", CONTROL_FIELDS, {"geometry_msgs/Twist": _of_cmd_vel}),
    Role("pose", "pose", POSE_FIELDS, _POSES),
    # A virtual vehicle publishes it.
    Role("true_pose", "true_pose", POSE_FIELDS, _POSES),
    Role("battery", "battery", ("voltage",), {"std_msgs/Float32": lambda m: (m.data,)}),
    Role("battery", "status", ("voltage",), _STATUS),
    Role("toggle", "in_flight", (), {"std_msgs/Empty": lambda message: ()}),
)

#: Pattern of the name of a vehicle at the end of a topic's, by which launch files tell vehicles
#: apart: /refHY4. It has a digit, unlike /ref_descent, and a letter, unlike /state2.
VEHICLE = r"(?:_?(?P<vehicle>[A-Za-z]+\d\w*?))?"

#: Types that are not series, with the names of their topics below a namespace.
EVENT_TYPES = {
    "crazyflie_msgs/FlightStatus": rf"in_flight{VEHICLE}_flight_status|.*flight_status",
    "crazyflie_msgs/FilterStatus": rf"in_flight{VEHICLE}_filter_status|.*filter_status",
    "crazyflie_msgs/VehicleStatus": r"vehicle_status",
    "dynamic_reconfigure/Config": r".+/parameter_updates",
    "rosgraph_msgs/Log": r"rosout",
    "rcl_interfaces/Log": r"rosout",
    "diagnostic_msgs/DiagnosticArray": r"diagnostics",
    "tf2_msgs/TFMessage": r"tf",
    "tf/tfMessage": r"tf",
    "motion_capture_tracking_interfaces/NamedPoseArray": r"poses",
}


@dataclass(frozen=True)
class Topic:
    """How messages of a connection are read."""

    namespace: str  #: Namespace of the vehicle, without slashes at its ends.
    role: Role | None  #: The series; None for messages that are events.
    #: ``decode(data)`` returns stamp (s, 0 without one), number in sequence, and a row or, without
    #: a role, the message.
    decode: Callable[[bytes], tuple[float, int, Any]]


def topic_of(connection: Connection, names: dict[str, str]) -> Topic | None:
    """Return how a connection is read; None if a report does not need it.

    For ``names`` see `bag_log.read`. `TopicError`: its type is not defined here, or differently.
    """
    if (found := role_of(connection.topic, connection.datatype, names)) is not None:
        namespace, role = found
        return Topic(namespace, role, _decoder(connection, role.rows[connection.datatype]))
    if connection.datatype in EVENT_TYPES:
        of_event = namespace_of(connection.topic, EVENT_TYPES[connection.datatype])
        if of_event is not None:
            return Topic(of_event, None, _decoder(connection, lambda message: message))
    return None


def role_of(topic: str, datatype: str, names: dict[str, str]) -> tuple[str, Role] | None:
    """Return the namespace and the series of a topic of a type; None if it has no role."""
    for role in ROLES:
        own = names.get(role.name, role.topics).strip("/")
        namespace = namespace_of(topic, f"(?:{own}){VEHICLE}")
        if namespace is not None and datatype in role.rows:
            return namespace, role
    return None


def row_of(topic: str, message: Any) -> Row:
    """Return the row of a message on a topic that has a role."""
    found = role_of(topic, message._type, {})
    if found is None:
        raise ValueError(f"{topic} ({message._type}) has no role")
    return found[1].rows[message._type](message)


def expected() -> str:
    """Return names and types of topics, one of which a bag must have for a flight."""
    return "; ".join(
        f"{role.topics.replace('|', ' or ')} ({' or '.join(role.rows)})"
        for role in ROLES
        if role.name in ("state", "final_control", "cmd_vel", "pose")
    )


def namespace_of(topic: str, names: str) -> str | None:
    """Return the namespace of a topic, without slashes at its ends; None if its name is another.

    ``names`` is a pattern of its name; where it contains `VEHICLE`, that is a namespace, too.
    """
    match = re.fullmatch(rf"/?(?:(?P<above>.*)/)?(?:{names})", topic)
    if match is None:
        return None
    found = match.groupdict()
    return "/".join(filter(None, ((found["above"] or "").strip("/"), found.get("vehicle"))))


def seconds(stamp: Any) -> float:
    """Return a time of a message, of ROS 1 or 2, in s."""
    return stamp.to_sec() if hasattr(stamp, "to_sec") else stamp.sec + 1e-9 * stamp.nanosec


def _decoder(connection, convert):
    deserialize = connection.deserializer()

    def decode(data):
        message = deserialize(data)
        header = getattr(message, "header", None)
        stamp = seconds(header.stamp) if header else 0.0
        return stamp, getattr(header, "seq", 0), convert(message)

    return decode
