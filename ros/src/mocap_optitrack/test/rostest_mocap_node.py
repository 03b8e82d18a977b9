"""The node in a process of its own, with a virtual motion capture server."""

import math
import subprocess
import time

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Pose2D, PoseStamped
from tf2_msgs.msg import TFMessage
from virtual_capture import LIMIT, MovingVehicles, mocap_launch, virtual_mocap

from crazyflie_utils.testing.peer import listening
from crazyflie_utils.testing.programs import free_port

HALF = 0.5**0.5

VEHICLES = {
    # Number: name, position, velocity, quaternion.
    1: ("cf1", (1.0, 2.0, 0.5), (0.5, 0.0, 0.0), (0.0, 0.0, HALF, HALF)),
    7: ("cf7", (-1.0, 0.0, 1.5), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
    9: ("unasked", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
}


def config(port):
    """Return a mocap.yaml, with bodies by number, by name, and one that is nowhere."""
    return {
        "stale_after": 1.0,
        "rigid_bodies": {
            "1": {
                "pose": "Robot_1/pose",
                "pose2d": "Robot_1/ground_pose",
                "child_frame_id": "Robot_1/base_link",
                "parent_frame_id": "world",
            },
            "cf7": {"pose": "/cf7/pose", "child_frame_id": "cf7"},
            "30": {"pose": "Robot_30/pose"},
        },
        "optitrack_config": {
            "server_address": "127.0.0.1",
            "multicast_address": "224.0.0.1",
            "command_port": port,
            "data_port": 9000,
        },
    }


def latest(heard):
    """Return the last message that has come, and forget those before."""
    return [heard.next(), *heard.drain()][-1]


def wait_for_status(component, level, text=""):
    """Wait until diagnostics say so of a component, and return its figures."""

    def matching(message):
        return [
            status
            for status in message.status
            if status.name == f"mocap_node: {component}"
            and status.level == level
            and text in status.message
        ]

    with listening("/diagnostics", DiagnosticArray) as diagnostics:
        (status,) = matching(diagnostics.next(matching))
    return {value.key: value.value for value in status.values}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Run the node, and server and scene after it has reported that no server answers."""
    observer_port, port = free_port(), free_port()
    with mocap_launch(tmp_path_factory.mktemp("config"), config(port)):
        wait_for_status("stream", DiagnosticStatus.ERROR, f"UDP port {port}: is Motive running")
        with (
            virtual_mocap(port, observer_port, latency=0.3),
            MovingVehicles(observer_port, VEHICLES) as scene,
        ):
            yield scene


def test_a_server_that_comes_late_is_found(scene):
    wait_for_status("stream", DiagnosticStatus.OK)


def test_poses_have_the_time_of_the_exposure(scene):
    with listening("/mocap_node/Robot_1/pose", PoseStamped) as poses:
        message = poses.next()
    assert message.header.frame_id == "world"
    moment = message.header.stamp.to_sec() - time.time() + time.monotonic()
    # At half a meter per second: 50 ms; the frame took 300 ms to come.
    x, y, z = scene.position(1, moment)
    position = message.pose.position
    assert (position.x, position.y, position.z) == pytest.approx((x, y, z), abs=0.025)
    assert position.x != pytest.approx(scene.position(1, time.monotonic())[0], abs=0.1)
    rotation = message.pose.orientation
    assert (rotation.x, rotation.y) == (0.0, 0.0)
    assert (rotation.z, rotation.w) == pytest.approx((HALF, HALF))


def test_ground_poses_and_tf_agree_with_poses(scene):
    with (
        listening("/mocap_node/Robot_1/pose", PoseStamped) as poses,
        listening("/mocap_node/Robot_1/ground_pose", Pose2D) as ground_poses,
        listening("/tf", TFMessage) as tf,
    ):
        # Names are known a little later than numbers.
        begin = tf.next(lambda m: len(m.transforms) == 2).transforms[0].header.stamp
        ground_begin = ground_poses.next()
        # One that came when all three were listened to; the vehicle flies along x.
        pose = poses.next(lambda p: p.header.stamp > begin and p.pose.position.x > ground_begin.x)
        stamp, position = pose.header.stamp, pose.pose.position
        message = tf.next(lambda m: m.transforms[0].header.stamp >= stamp)
        ground_pose = ground_poses.next(lambda p: p.x >= position.x)
    first, second = message.transforms
    assert first.header.stamp == second.header.stamp == stamp
    assert (first.header.frame_id, first.child_frame_id) == ("world", "Robot_1/base_link")
    assert first.transform.translation.x == position.x
    assert first.transform.rotation == pose.pose.orientation
    assert (second.header.frame_id, second.child_frame_id) == ("world", "cf7")
    assert second.transform.translation.z == 1.5
    assert (ground_pose.x, ground_pose.y) == (position.x, position.y)
    assert ground_pose.theta == pytest.approx(0.5 * math.pi)


def test_diagnostics_of_a_working_stream(scene):
    figures = wait_for_status("stream", DiagnosticStatus.OK, "frames per second")
    assert float(figures["rate (Hz)"]) > 10.0
    assert float(figures["latency, mean (ms)"]) > 250.0
    assert "virtual_mocap at 127.0.0.1" in figures["server"]
    assert "unicast" in figures["server"]
    assert int(wait_for_status("rigid body 1", DiagnosticStatus.OK)["tracked"]) > 0


def test_a_body_that_is_nowhere_is_named_with_those_that_are_there(scene):
    wait_for_status("rigid body 30", DiagnosticStatus.ERROR, "9 (unasked)")


def test_a_body_that_is_not_tracked_is_not_published(scene):
    with (
        listening("/mocap_node/Robot_1/pose", PoseStamped) as lost,
        listening("/cf7/pose", PoseStamped) as seen,
    ):
        lost.next()
        rospy.set_param("/virtual_mocap/fault/invalid", "1")
        wait_for_status("rigid body 1", DiagnosticStatus.ERROR, "not tracked for")
        first = latest(seen).header.stamp
        wait_for_status("rigid body 1", DiagnosticStatus.ERROR, "not tracked for")
        assert latest(seen).header.stamp > first
        assert latest(lost).header.stamp < first
        rospy.set_param("/virtual_mocap/fault/invalid", "")
        assert lost.next().header.stamp > first
    wait_for_status("rigid body 1", DiagnosticStatus.OK)


def test_a_stream_that_pauses_is_reported_and_taken_up_again(scene):
    with listening("/cf7/pose", PoseStamped) as poses:
        poses.next()
        rospy.set_param("/virtual_mocap/fault/silent", True)
        wait_for_status("stream", DiagnosticStatus.ERROR, "no frames for 1 s")
        paused_at = latest(poses).header.stamp
        rospy.set_param("/virtual_mocap/fault/silent", False)
        assert poses.next().header.stamp > paused_at
    wait_for_status("stream", DiagnosticStatus.OK)


def test_a_bad_parameter_ends_the_process():
    rospy.set_param("/bad", config(free_port()) | {"up_axis": "x"})
    command = ["rosrun", "mocap_optitrack", "mocap_node", "__name:=bad"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
    assert ended.returncode == 1
    assert "/bad/up_axis is 'x'; expected one of z, y" in ended.stdout + ended.stderr
