"""A simulator in a process of its own, on a real master."""

import subprocess

import pytest
import rospy
import tf2_ros
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_utils.testing.peer import LIMIT, listening


@pytest.fixture
def transforms():
    """Return a queue of what the simulator broadcasts."""
    with listening("/tf", TFMessage) as transforms:
        yield transforms


def test_climbs_when_it_is_told_to(transforms):
    assert transforms.next().transforms[0].transform.translation.z == 0.0
    publisher = rospy.Publisher("/control/final", ControlStamped, queue_size=1)
    for _ in range(1000):
        publisher.publish(ControlStamped(control=Control(thrust=12.0)))
        transform = transforms.next().transforms[0]
        if transform.transform.translation.z > 0.2:
            break
    assert transform.transform.translation.z > 0.2
    assert transform.transform.translation.x == 0.5


def test_tf2_knows_the_vehicle():
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    transform = buffer.lookup_transform("world", "crazyflie", rospy.Time(), rospy.Duration(LIMIT))
    assert transform.header.stamp.to_sec() == pytest.approx(rospy.get_time(), abs=LIMIT)
    listener.unregister()


@pytest.mark.parametrize(
    ("name", "arguments", "reason"),
    [
        ("missing", [], "/missing/time_step is not set"),
        ("negative", ["_time_step:=-0.01"], "/negative/time_step is -0.01"),
    ],
)
def test_a_bad_parameter_ends_the_process(name, arguments, reason):
    executable = rospy.get_param("/simulator_type")
    command = ["rosrun", "crazyflie_simulator", executable, f"__name:={name}", *arguments]
    process = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
    assert process.returncode == 1
    assert reason in process.stdout + process.stderr
