"""Goals that stay, and goals that are moved by hand."""

import math

import pytest
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Joy
from std_msgs.msg import Header

from crazyflie_demo.node_parts import REPEATED
from crazyflie_demo.publish_pose_node import PublishPoseNode, PublishPoseTeleopNode
from crazyflie_demo.stream_nodes import ConstThrustNode
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess

PLACE = {"x": 1.0, "y": -2.0, "z": 0.5}
X, Y, Z, YAW = 4, 3, 1, 0


def launch(node, **parameters):
    process = FakeProcess()
    assert process.launch(node, "/cf/pose", {**PLACE, **parameters})
    return process


def last(process, topic="/cf/goal"):
    """Return the last goal: x, y, z, yaw."""
    pose = process.published(topic)[-1].pose
    p, q = pose.position, pose.orientation
    roll, pitch, yaw = rpy_from_quaternion(q.x, q.y, q.z, q.w)
    assert (roll, pitch) == pytest.approx((0.0, 0.0))
    return (p.x, p.y, p.z, yaw)


def move(process, duration, **sticks):
    """Hold the sticks for a while, as joy_node does: 20 messages a second."""
    axes = [0.0] * 8
    for name, value in sticks.items():
        axes[{"x": X, "y": Y, "z": Z, "yaw": YAW}[name]] = value
    for _ in range(round(duration * 20.0)):
        process.publish("/cf/joy", Joy(Header(frame_id=REPEATED), axes, []))
        process.advance(0.05)


def test_says_the_same_goal_again_and_again():
    process = launch(PublishPoseNode(), yaw=0.7, rate=10.0, worldFrame="/lab", name="target")
    process.advance(2.0)
    goals = process.published("/cf/target")
    assert len(goals) == 20
    assert last(process, "/cf/target") == pytest.approx((1.0, -2.0, 0.5, 0.7))
    assert goals[-1].header.frame_id == "lab"
    assert goals[-1].header.stamp.to_sec() == pytest.approx(102.0)


def test_moves_as_the_sticks_say():
    process = launch(PublishPoseTeleopNode())
    process.advance(0.5)
    assert last(process) == (1.0, -2.0, 0.5, 0.0)
    move(process, 2.0, x=1.0, yaw=-0.5)
    assert last(process) == pytest.approx((2.0, -2.0, 0.5, -1.0), abs=0.05)
    move(process, 1.0, y=1.0, z=-1.0)
    assert last(process) == pytest.approx((2.0, -1.5, 0.2, -1.0), abs=0.05)


def test_stays_when_the_joystick_is_silent():
    process = launch(PublishPoseTeleopNode(), **{"speed/x": 1.0})
    move(process, 0.5, x=1.0)
    process.advance(10.0)
    # Half a second by the stick, and another one until its last message is too old.
    assert last(process)[0] == pytest.approx(2.0, abs=0.1)


def test_goes_on_while_a_joystick_that_only_tells_changes_is_held_still():
    process = launch(PublishPoseTeleopNode(), **{"speed/x": 1.0})
    axes = [0.0] * 8
    axes[X] = 1.0
    process.publish("/cf/joy", Joy(axes=axes))
    process.advance(3.0)
    process.transport.unpublished.add("/cf/joy")
    process.advance(3.0)
    assert last(process)[0] == pytest.approx(4.0, abs=0.1)


def test_does_not_jump_after_a_pause():
    process = launch(PublishPoseTeleopNode(), **{"speed/x": 1.0})
    process.clock.set(200.0)
    process.publish("/cf/joy", Joy(axes=[1.0] * 8))
    process.advance(0.04)
    assert last(process)[0] == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("node", [PublishPoseNode, PublishPoseTeleopNode])
@pytest.mark.parametrize("changes", [{"x": math.nan}, {"rate": 0.0}, {"name": "two words"}])
def test_a_bad_parameter_is_named(node, changes):
    process = FakeProcess()
    assert not process.launch(node(), "/pose", {**PLACE, **changes})
    assert f"/pose/{next(iter(changes))}" in process.logged("error")[0]


def test_a_constant_thrust_begins_and_ends_with_none():
    process = FakeProcess()
    node = ConstThrustNode()
    assert process.launch(node, "/cf/const_thrust", {"thrust": 20000.0, "rate": 10.0})
    process.advance(1.0)
    setpoints = process.published("/cf/cmd_vel")
    assert [setpoint.linear.z for setpoint in setpoints] == [0.0, *[20000.0] * 9]
    node.shutdown()
    assert setpoints[-1] == Twist()


def test_a_constant_thrust_has_its_limit():
    process = FakeProcess()
    assert not process.launch(ConstThrustNode(), "/const_thrust", {"thrust": 60001.0})
    assert "/const_thrust/thrust is 60001" in process.logged("error")[0]


def test_the_speeds_may_be_changed_in_flight():
    process = launch(PublishPoseTeleopNode())
    move(process, 1.0, x=1.0)
    before = last(process)
    process.reconfigure("/cf/pose", **{"speed/x": 0.0})
    move(process, 1.0, x=1.0)
    assert last(process) == before
    with pytest.raises(ServiceError, match="/cf/pose/speed/x is -1.0; expected"):
        process.reconfigure("/cf/pose", **{"speed/x": -1.0})


def test_a_constant_thrust_may_be_changed():
    process = FakeProcess()
    assert process.launch(ConstThrustNode(), "/cf/const_thrust")
    process.reconfigure("/cf/const_thrust", thrust=20000.0)
    with pytest.raises(ServiceError, match="/cf/const_thrust/thrust is 60001.0; expected"):
        process.reconfigure("/cf/const_thrust", thrust=60001.0)
    process.advance(0.04)
    assert process.published("/cf/cmd_vel")[-1].linear.z == 20000.0
