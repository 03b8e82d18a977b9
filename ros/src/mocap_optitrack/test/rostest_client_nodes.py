"""Nodes with the names of vrpn_client_ros and ros_vrpn_client, and a VRPN server."""

import platform
import sys

import pytest
from geometry_msgs.msg import PoseStamped
from tf2_msgs.msg import TFMessage
from vrpn_server import VrpnServer

from crazyflie_utils.testing.peer import listening
from crazyflie_utils.testing.programs import running

pytestmark = pytest.mark.skipif(
    platform.machine() != "x86_64" or sys.version_info >= (3, 14),
    reason="the motioncapture package has no other binaries",
)

STILL = (4.0, 5.0, 6.0, 0.0, 0.0, 0.6, 0.8)


@pytest.fixture
def server():
    with VrpnServer({"cf1": (1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0), "cf 2": STILL}) as server:
        yield server


def client(server, package, program, /, **parameters):
    given = {"port": server.port, **parameters}
    arguments = [f"_{name}:={value}" for name, value in given.items()]
    return running("rosrun", package, program, *arguments)


def test_trackers_have_poses_and_frames(server):
    with (
        client(server, "vrpn_client_ros", "vrpn_client_node", server="127.0.0.1", frame_id="/lab"),
        listening("/vrpn_client_node/cf1/pose", PoseStamped) as poses,
        listening("/vrpn_client_node/cf_2/pose", PoseStamped) as others,
        listening("/tf", TFMessage) as frames,
    ):
        pose = poses.next()
        assert pose.header.frame_id == "lab"
        assert pose.pose.position.x == pytest.approx(1.0, abs=1e-4)
        server.poses["cf1"] = (1.5, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0)
        poses.next(lambda message: message.pose.position.x > 1.4)
        other = others.next().pose
        assert (other.position.y, other.orientation.z) == (5.0, pytest.approx(0.6))
        message = frames.next(lambda message: len(message.transforms) == 2)
        names = {(each.header.frame_id, each.child_frame_id) for each in message.transforms}
        assert names == {("lab", "cf1"), ("lab", "cf 2")}


def test_one_tracker_has_its_frame(server):
    frame = "/vicon/cf1/cf1"
    with (
        client(server, "ros_vrpn_client", "ros_vrpn_client", ip="127.0.0.1", child_frame_id=frame),
        listening("/tf", TFMessage) as frames,
    ):
        (transform,) = frames.next().transforms
        assert (transform.header.frame_id, transform.child_frame_id) == ("world", "vicon/cf1/cf1")
        assert transform.transform.translation.z == 3.0
