"""Bags of flights that are known in closed form."""

import contextlib
import math

import numpy as np
import rosbag
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from dynamic_reconfigure.msg import Config, DoubleParameter
from geometry_msgs.msg import PoseStamped, TransformStamped, Twist
from rosbags.rosbag2 import StoragePlugin, Writer
from rosgraph_msgs.msg import Log
from std_msgs.msg import Empty, Float32, Header
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    FilterStatus,
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_reports import bag_ros2

START = 1000.0
TAKEOFF, FLYING, LAND, LANDED, END = 1.0, 4.0, 9.0, 13.0, 15.0
OFFSET, SPEED, SINK, DELAY = 0.004, 0.5, 0.3, 0.005
PHASES = [
    (0.0, FlightStatus.ON_GROUND),
    (TAKEOFF, FlightStatus.TAKING_OFF),
    (FLYING, FlightStatus.FLYING),
    (LAND, FlightStatus.LANDING),
    (LANDED, FlightStatus.ON_GROUND),
]


def stamp(time):
    """Return the ROS time of a time of the flight."""
    return rospy.Time.from_sec(START + time)


def header(time, number=1):
    """Return a header."""
    return Header(seq=number, stamp=stamp(time))


def height(time):
    """Return height and vertical velocity: up to 1 m in 2 s, `OFFSET` above it, down."""
    if time < TAKEOFF:
        return 0.0, 0.0
    if time < LAND:
        rising = SPEED * (time - TAKEOFF)
        return (rising, SPEED) if rising < 1.0 + OFFSET else (1.0 + OFFSET, 0.0)
    z = 1.0 + OFFSET - SINK * (time - LAND)
    return (z, -SINK) if z > 0.0 else (0.0, 0.0)


def steps(gap=()):
    """Yield number and time of each state, at 100 Hz, but for those within a gap."""
    for number, time in enumerate(np.arange(0.0, END, 0.01), 1):
        if not gap or not gap[0] < time < gap[1]:
            yield number, float(time)


def write_flight(bag, name="", gap=(), is_typed=True, tilt=0.0, drift=0.0, lateness=None):
    """Write the topics of a vehicle that flies (C++ workspace: without FlightStatus).

    Its roll is commanded to +-``tilt`` (rad) in turn. Its true y differs from the estimate by
    ``drift`` (m/s) times the time. With ``lateness`` (s) its roll is a sine of 1 Hz, which follows
    its command that late.
    """
    top = f"/{name}" if name else ""
    for number, time in steps(gap):
        z, speed = height(time)
        state = PositionVelocityYawState(z=z, z_dot=speed)
        message = PositionVelocityYawStateStamped(header=header(time, number), state=state)
        bag.write(f"{top}/state", message, stamp(time))
        if drift:
            true = PoseStamped(header=header(time, number))
            true.pose.position.y, true.pose.position.z = drift * time, z
            true.pose.orientation.w = 1.0
            bag.write(f"{top}/true_pose", true, stamp(time))
        thrust = 9.81 if TAKEOFF <= time < LANDED else 0.0
        roll = tilt if number % 2 else -tilt
        if lateness is not None:
            roll = 0.1 * math.sin(2.0 * math.pi * time)
            pose = PoseStamped(header=header(time, number))
            pose.pose.orientation.w = 1.0
            pose.pose.orientation.x = 0.05 * math.sin(2.0 * math.pi * (time - lateness))
            bag.write(f"{top}/pose", pose, stamp(time))
        control = ControlStamped(header(time, number), Control(roll=roll, thrust=thrust))
        bag.write(f"{top}/control/final", control, stamp(time + DELAY))
    hover = PositionVelocityStateStamped(header(TAKEOFF), PositionVelocityState(z=1.0))
    bag.write(f"{top}/ref", hover, stamp(TAKEOFF))
    if is_typed:
        for time, state in PHASES:
            status = FlightStatus(header=header(time), state=state)
            bag.write(f"{top}/in_flight_flight_status", status, stamp(time))
    for time in (FLYING, LAND):
        bag.write(f"{top}/in_flight", Empty(), stamp(time))


def write_events(bag, name=""):
    """Write what a report lists, all of it in flight."""
    top = f"/{name}" if name else ""
    refused = Log(header=header(5.0), level=4, name=f"{top}/node", msg=f"{top}/go refused: too far")
    for topic in ("/rosout", "/rosout_agg"):
        bag.write(topic, refused, stamp(5.0))
    for time, count in ((5.1, "0"), (6.1, "2")):
        values = [KeyValue("rejected: is too far away", count)]
        poses = DiagnosticStatus(name=f"{top}/state_estimator: poses", values=values)
        bag.write("/diagnostics", DiagnosticArray(header(time), [poses]), stamp(time))
    for time, gain in ((5.2, 1.0), (6.2, 2.0)):
        config = Config(doubles=[DoubleParameter("gain", gain)])
        bag.write(f"{top}/lqr_controller/parameter_updates", config, stamp(time))
    for time, state in ((6.3, FilterStatus.HOLDING), (7.3, FilterStatus.EMERGENCY)):
        status = FilterStatus(header=header(time), state=state, reason="no control")
        bag.write(f"{top}/in_flight_filter_status", status, stamp(time))


def write_driven(bag, name="cf1", has_pose=True):
    """Write what crazyflie_ros has of the flight: cmd_vel, goal, battery, and pose or only /tf."""
    for number, time in steps():
        z, _ = height(time)
        twist = Twist()
        twist.linear.z = 42000.0 if TAKEOFF <= time < LANDED else 0.0
        twist.linear.x = 2.0  # Pitch, deg.
        bag.write(f"/{name}/cmd_vel", twist, stamp(time + DELAY))
        if has_pose:
            pose = PoseStamped(header=header(time, number))
            pose.pose.position.z, pose.pose.orientation.w = z, 1.0
            bag.write(f"/{name}/pose", pose, stamp(time))
        else:
            transform = TransformStamped(
                header=header(time), child_frame_id=f"/vicon/{name}/{name}"
            )
            transform.transform.translation.z, transform.transform.rotation.w = z, 1.0
            bag.write("/tf", TFMessage([transform]), stamp(time))
    goal = PoseStamped(header=header(TAKEOFF))
    goal.pose.position.z, goal.pose.orientation.w = 1.0, 1.0
    bag.write(f"/{name}/goal", goal, stamp(TAKEOFF))
    bag.write(f"/{name}/battery", Float32(3.9), stamp(5.0))


@contextlib.contextmanager
def written(path, compression="none"):
    """Yield a bag that is written, with chunks of 100 kB."""
    with rosbag.Bag(str(path), "w", compression, chunk_threshold=100_000) as bag:
        yield bag


def flight_bag(path, compression="none", **options):
    """Return the path of a bag with a flight."""
    with written(path, compression) as bag:
        write_flight(bag, **options)
    return path


@contextlib.contextmanager
def ros2_bag(folder, storage=StoragePlugin.MCAP, compression=None, definitions=None):
    """Yield a function that writes topic, type ("package/Name"), fields and time of the flight.

    ``compression``: mode and format; ``definitions``: by type, other ones than the messages have.
    """
    writer = Writer(folder, version=9, storage_plugin=storage)
    if compression:
        writer.set_compression(*compression)
    connections = {}
    with writer:

        def write(topic, datatype, fields, time):
            name = bag_ros2.ros2_name(datatype)
            if topic not in connections:
                other = (
                    {"msgdef": definitions[datatype], "rihs01": "RIHS01_0"}
                    if (datatype in (definitions or {}))
                    else {"typestore": bag_ros2.types()}
                )
                connections[topic] = writer.add_connection(topic, name, **other)
            data = bag_ros2.types().serialize_cdr(bag_ros2.message(datatype, fields), name)
            writer.write(connections[topic], round((START + time) * 1e9), data)

        yield write


def ros2_header(time, frame=""):
    """Return the fields of a header of ROS 2."""
    return (int(START + time), 0), frame


def ros2_pose(z):
    """Return the fields of a pose of ROS 2 at a height (m)."""
    return (0.0, 0.0, z), (0.0, 0.0, 0.0, 1.0)


def write_crazyswarm2(write, name="cf1", poses="pose", end=END):
    """Write what crazyswarm2 has of the flight; poses on "pose" or on motion capture's "poses"."""
    for _, time in steps():
        if time > end:
            break
        z, _ = height(time)
        if poses == "pose":
            pose = ros2_header(time), ros2_pose(z)
            write(f"/{name}/pose", "geometry_msgs/PoseStamped", pose, time)
        else:
            mocap = "motion_capture_tracking_interfaces/NamedPoseArray"
            write("/poses", mocap, (ros2_header(time), [(name, ros2_pose(z))]), time)
    goal = ros2_header(TAKEOFF), ros2_pose(1.0)
    write(f"/{name}/cmd_full_state", "crazyflie_interfaces/FullState", goal, TAKEOFF)
    status = {"battery_voltage": 3.9}
    write(f"/{name}/status", "crazyflie_interfaces/Status", status, 5.0)
    line = {"level": 30, "name": f"{name}.link", "msg": "latency is high"}
    write("/rosout", "rcl_interfaces/Log", line, 6.0)
