"""Imports of users' scripts, from any folder."""

import inspect
import subprocess
import sys

import crazyflie
import pytest
import rospy
import tf2_ros
from crazyflie import Crazyflie
from geometry_msgs.msg import Transform, TransformStamped, Vector3
from std_msgs.msg import Header

SIGNATURES = {
    "setGroupMask": "groupMask",
    "takeoff": "targetHeight, duration, groupMask=0",
    "land": "targetHeight, duration, groupMask=0",
    "stop": "groupMask=0",
    "goTo": "goal, yaw, duration, relative=False, groupMask=0",
    "uploadTrajectory": "trajectoryId, pieceOffset, trajectory",
    "startTrajectory": "trajectoryId, timescale=1.0, reverse=False, relative=True, groupMask=0",
    "position": "",
    "emergency": "",
    "notifySetpointsStop": "remainValidMillisecs=100, groupMask=0",
    "getVoltage": "",
    "cmdFullState": "pos, vel, acc, yaw, omega",
    "cmdPosition": "pos, yaw=0.0",
    "cmdVelocityWorld": "vel, yawRate",
    "cmdStop": "",
    "getParam": "name",
    "setParam": "name, value",
    "setParams": "params",
}


def arguments(function):
    """Return the arguments of a method as it was called, without their types."""
    signature = inspect.signature(function)
    bare = [each.replace(annotation=each.empty) for each in signature.parameters.values()]
    return ", ".join(str(each) for each in bare[1:])


@pytest.mark.parametrize("name", SIGNATURES)
def test_methods_take_what_scripts_give(name):
    assert arguments(getattr(Crazyflie, name)) == SIGNATURES[name]


def test_a_vehicle_has_a_prefix_and_a_frame():
    assert arguments(Crazyflie.__init__) == "prefix, tf"


def vehicle(tf):
    """Return a vehicle that waits for no services."""
    made = Crazyflie.__new__(Crazyflie)
    made.prefix, made.tf, made._buffer = "/cf", tf, None
    return made


@pytest.fixture(autouse=True)
def now(monkeypatch):
    """Set the time to 100 s, and have limits pass at once."""
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(100.0))
    monkeypatch.setattr(crazyflie, "_TF_LIMIT", 0.05)


class Listener:
    """A tf.TransformListener that knows one transform."""

    def __init__(self, stamp=0.0):
        self._stamp = rospy.Time(stamp)

    def getLatestCommonTime(self, target, source):  # noqa: N802
        return self._stamp

    def waitForTransform(self, target, source, time, limit):  # noqa: N802
        self.asked = (target, source)

    def lookupTransform(self, target, source, time):  # noqa: N802
        assert (target, source) == self.asked == ("world", "/cf")
        return (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0)


class Buffer(tf2_ros.BufferCore):
    """A tf2_ros.Buffer that waits for nothing."""

    def lookup_transform(self, target, source, time, limit):
        return self.lookup_transform_core(target, source, time)


def buffer_with(frame, stamp=0.0, world="world"):
    """Return a buffer that knows one transform, a static one if it has no stamp."""
    header = Header(frame_id=world, stamp=rospy.Time(stamp))
    transform = TransformStamped(header, frame, Transform())
    transform.transform.translation = Vector3(1.0, 2.0, 3.0)
    transform.transform.rotation.w = 1.0
    buffer = Buffer()
    add = buffer.set_transform if stamp else buffer.set_transform_static
    add(transform, "test")
    return buffer


def test_the_position_comes_from_who_listens_to_tf():
    assert vehicle(Listener()).position().tolist() == [1.0, 2.0, 3.0]
    assert vehicle(buffer_with("cf")).position().tolist() == [1.0, 2.0, 3.0]


def test_the_position_is_that_of_the_frame_that_is_named():
    made = vehicle("/vicon/cf/cf")
    made._buffer = buffer_with("vicon/cf/cf")
    assert made.position().tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("tf", [Listener, lambda stamp: buffer_with("cf", stamp)])
def test_an_old_position_is_refused(tf):
    assert vehicle(tf(99.9)).position().tolist() == [1.0, 2.0, 3.0]
    text = "/cf in world: the last position is 1.5 s old; expected at most 0.5 s"
    with pytest.raises(tf2_ros.TransformException, match=text):
        vehicle(tf(98.5)).position()
    # The clock was set back by an hour meanwhile.
    with pytest.raises(tf2_ros.TransformException, match="the last position is -3600.0 s old"):
        vehicle(tf(3700.0)).position()


def test_the_world_has_the_name_that_the_script_was_given():
    made = vehicle(buffer_with("cf", 99.9, "hall"))
    made._world = "hall"
    assert made.position().tolist() == [1.0, 2.0, 3.0]


def test_a_script_far_away_imports_them(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import crazyflie\n"
        "import uav_trajectory\n"
        "from crazyflie import Crazyflie\n"
        "from uav_trajectory import Polynomial, Polynomial4D, Trajectory, TrajectoryOutput\n"
        "assert crazyflie.Crazyflie is Crazyflie\n"
        "assert uav_trajectory.Trajectory is Trajectory\n"
        # As execute_trajectory.py of the SDK does.
        "import tf_conversions\n"
        "x, y, z, w = tf_conversions.transformations.quaternion_from_euler(0, 0, 1.0)\n"
        "assert (x, y) == (0.0, 0.0) and w > z > 0.0\n"
    )
    subprocess.run([sys.executable, script], cwd=tmp_path, check=True, timeout=120)
