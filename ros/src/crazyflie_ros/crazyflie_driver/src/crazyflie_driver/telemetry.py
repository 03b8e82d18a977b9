"""Log data of the firmware as messages: which variables, how often, in which units."""

import math
from collections.abc import Callable, Container, Sequence
from typing import NamedTuple

import genpy
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Vector3
from sensor_msgs.msg import Imu, MagneticField, Temperature
from std_msgs.msg import Float32, Header

from crazyflie_link.log import quaternion_from_compressed
from crazyflie_model.units import GRAVITY

#: Periods of imu and pose, and of the rest, ms: those of the C++ driver.
FAST_MS, SLOW_MS = 10, 100
_MOST_VARIABLES = 6  #: Variables of four bytes that fit in a log packet's 26 bytes.
_UNKNOWN = -1.0  #: First element of a covariance: there is no such measurement (sensor_msgs/Imu).


class StandardTopic(NamedTuple):
    """A topic that every vehicle has; ``convert(header, values)`` returns its message.

    Its frame is the fixed one if it is in the world, or else the vehicle's.
    """

    name: str
    message_type: type[genpy.Message]
    period_ms: int
    variables: tuple[str, ...]
    convert: Callable[[Header, Sequence[float]], genpy.Message]
    in_world: bool = False


def _imu(header, values):
    message = Imu(header=header)
    message.orientation_covariance[0] = _UNKNOWN
    # The firmware measures in g and degrees/s.
    message.linear_acceleration = Vector3(*(GRAVITY * value for value in values[:3]))
    message.angular_velocity = Vector3(*map(math.radians, values[3:]))
    return message


def _pose(header, values):
    message = PoseStamped(header=header)
    message.pose.position = Point(*values[:3])
    message.pose.orientation = Quaternion(*quaternion_from_compressed(values[3]))
    return message


def _float(_, values):
    return Float32(values[0])


STANDARD = (
    StandardTopic(
        "imu", Imu, FAST_MS, ("acc.x", "acc.y", "acc.z", "gyro.x", "gyro.y", "gyro.z"), _imu
    ),
    StandardTopic(
        "pose",
        PoseStamped,
        FAST_MS,
        ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z", "stateEstimateZ.quat"),
        _pose,
        in_world=True,
    ),
    StandardTopic(
        "magnetic_field",
        MagneticField,
        SLOW_MS,
        ("mag.x", "mag.y", "mag.z"),
        lambda header, values: MagneticField(header=header, magnetic_field=Vector3(*values)),
    ),
    StandardTopic(
        "temperature",
        Temperature,
        SLOW_MS,
        ("baro.temp",),
        lambda header, values: Temperature(header=header, temperature=values[0]),
    ),
    StandardTopic("pressure", Float32, SLOW_MS, ("baro.pressure",), _float),
    StandardTopic("battery", Float32, SLOW_MS, ("pm.vbat",), _float),
)


def packed(
    topics: list[StandardTopic], known: Container[str]
) -> tuple[list[list[StandardTopic]], dict[str, list[str]]]:
    """Put the variables of topics that have the same period into common log blocks.

    Returns groups of topics that fit in a log packet each, and for every topic that the vehicle
    cannot fill the variables that it lacks.
    """
    missing: dict[str, list[str]] = {}
    groups: list[list[StandardTopic]] = []
    for topic in topics:
        lacking = [variable for variable in topic.variables if variable not in known]
        if lacking:
            missing[topic.name] = lacking
            continue
        for group in groups:
            size = sum(len(other.variables) for other in group) + len(topic.variables)
            if group[0].period_ms == topic.period_ms and size <= _MOST_VARIABLES:
                group.append(topic)
                break
        else:
            groups.append([topic])
    return groups, missing
