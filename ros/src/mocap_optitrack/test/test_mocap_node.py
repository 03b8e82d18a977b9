"""The node on a fake process, with frames made by hand."""

import math
from pathlib import Path
from unittest.mock import Mock

import genpy
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, Pose2D, Quaternion

from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess
from mocap_optitrack.client_nodes import ViconBridgeNode, VrpnClientNode
from mocap_optitrack.frames import Frame, SeenBody
from mocap_optitrack.library_source import LibrarySource
from mocap_optitrack.mocap_node import MocapNode
from mocap_optitrack.mocap_parameters import NatNetParameters
from mocap_optitrack.natnet_source import NatNetSource

SHIPPED = Path(__file__).parents[1] / "config" / "mocap.yaml"

TURNED = (0.0, 0.0, math.sin(0.2), math.cos(0.2))
BODIES = {
    "1": {
        "pose": "Robot_1/pose",
        "pose2d": "Robot_1/ground_pose",
        "child_frame_id": "Robot_1/base_link",
        "parent_frame_id": "lab",
    },
    "cf7": {"pose": "/seven", "child_frame_id": "seven"},
    "9": {"pose2d": "nine"},
}


class SilentNode(MocapNode):
    """A node that is not connected to anything, but says how it would be."""

    def make_receiver(self, handle):
        self.source = self._make_source(handle)
        return Mock()


def flat(parameters, prefix=""):
    """Return a tree of parameters by their full names, with its branches as they are."""
    result = {}
    for key, value in parameters.items():
        result[prefix + key] = value
        if isinstance(value, dict):
            result |= flat(value, f"{prefix}{key}/")
    return result


def launch(**changes):
    """Return a process and the node in it."""
    process, node = FakeProcess(), SilentNode()
    assert process.launch(node, "/mocap_node", flat({"rigid_bodies": BODIES, **changes}))
    return process, node


def refusal(parameters):
    """Return what is logged when the node refuses to start."""
    process = FakeProcess()
    assert not process.launch(SilentNode(), "/mocap_node", flat(parameters))
    return process.logged("error")[0]


def body(number, name=None, is_tracked=True):
    """Return a body that is somewhere."""
    return SeenBody(number, name, (1.0, 2.0, 3.0), TURNED, is_tracked)


def show(process, node, *bodies):
    """Process a frame."""
    process.advance(0.01)
    node.on_frame(Frame(None, None, process.clock.time(), bodies))


def test_poses_ground_poses_and_tf():
    process, node = launch()
    show(process, node, body(1), body(5, "cf7"))
    (pose,) = process.published("/mocap_node/Robot_1/pose")
    assert pose.header.stamp.to_sec() == pytest.approx(100.01)
    assert pose.header.frame_id == "lab"
    assert pose.pose.position == Point(1.0, 2.0, 3.0)
    assert pose.pose.orientation == Quaternion(*TURNED)
    (ground_pose,) = process.published("/mocap_node/Robot_1/ground_pose")
    assert ground_pose == Pose2D(1.0, 2.0, pytest.approx(0.4))
    (tf,) = process.published("/tf")
    frames = [(t.header.frame_id, t.child_frame_id) for t in tf.transforms]
    assert frames == [("lab", "Robot_1/base_link"), ("world", "seven")]
    assert all(t.header.stamp == pose.header.stamp for t in tf.transforms)
    assert tf.transforms[0].transform.translation.y == 2.0
    assert tf.transforms[0].transform.rotation == pose.pose.orientation
    assert len(process.published("/seven")) == 1


def test_what_is_not_configured_is_not_published():
    process, node = launch()
    show(process, node, body(9))
    assert len(process.published("/mocap_node/nine")) == 1
    assert process.published("/tf") == []
    show(process, node, body(1, is_tracked=False), body(2))
    assert process.published("/mocap_node/Robot_1/pose") == []
    assert "/cf7/pose2d" not in process.transport.publishers


def test_a_stream_with_y_up():
    process, node = launch(up_axis="y")
    show(process, node, body(1))
    (pose,) = process.published("/mocap_node/Robot_1/pose")
    assert pose.pose.position == Point(1.0, -3.0, 2.0)
    assert "axis y of its stream points up" in process.logged("info")[0]


def test_stale_frames_are_dropped():
    process, node = launch(stale_after=0.05)
    show(process, node, body(1))
    node.on_frame(Frame(None, None, process.clock.time(), (body(1),)))
    assert len(process.published("/mocap_node/Robot_1/pose")) == 1


def test_the_largest_age_may_be_changed():
    process, node = launch()
    node.on_connected("a server")
    process.reconfigure("/mocap_node", stale_after=2.0)
    for _ in range(3):
        show(process, node, body(1), body(5, "cf7"), body(9))
        process.advance(1.0)
    statuses = process.published("/diagnostics")[-1].status
    assert {status.level for status in statuses} == {DiagnosticStatus.OK}
    with pytest.raises(ServiceError, match="/mocap_node/stale_after is 0.0; expected"):
        process.reconfigure("/mocap_node", stale_after=0.0)


def test_diagnostics():
    process, node = launch()
    node.on_connected("a server")
    for _ in range(99):
        show(process, node, body(1), body(9, is_tracked=False))
    process.advance(0.01)
    (message,) = process.published("/diagnostics")
    assert message.header.stamp.to_sec() == pytest.approx(101.0)
    assert [(s.name, s.level) for s in message.status] == [
        ("mocap_node: stream", DiagnosticStatus.OK),
        ("mocap_node: rigid body 1", DiagnosticStatus.OK),
        ("mocap_node: rigid body cf7", DiagnosticStatus.WARN),
        ("mocap_node: rigid body 9", DiagnosticStatus.WARN),
    ]
    assert {s.hardware_id for s in message.status} == {"natnet"}
    figures = {value.key: value.value for value in message.status[0].values}
    assert figures["rate (Hz)"] == "99.0"
    assert process.logged("warn") == []


def test_a_body_that_is_never_seen_is_warned_of_once_in_a_while():
    process, node = launch()
    node.on_connected("a server")
    for _ in range(500):
        show(process, node, body(1), body(9), body(3, "cf3"))
    (text,) = process.logged("warn")
    assert "rigid body cf7: not in the stream so far" in text
    assert "3 (cf3)" in text


def test_a_failure_is_warned_of_and_reported():
    process, node = launch()
    for _ in range(3):
        node.on_failure("no server answers")
    process.advance(1.0)
    assert process.logged("warn") == ["/mocap_node: no server answers (retrying)"]
    (message,) = process.published("/diagnostics")
    assert {status.level for status in message.status} == {DiagnosticStatus.ERROR}
    assert message.status[0].message == "no server answers"
    node.on_connected("a server")
    assert "/mocap_node: connected to a server" in process.logged("info")


def show_timed(process, node, wait=0.01):
    """Process a frame, just sent by a server whose clock is 100 s behind."""
    process.advance(wait)
    now = process.clock.time()
    node.on_frame(Frame(now - 100.005, now - 100.0, now, (body(1),)))


def test_a_silence_of_the_stream_costs_nothing_but_itself():
    process, node = launch()
    topic = "/mocap_node/Robot_1/pose"
    node.on_connected("a server")
    for _ in range(100):
        show_timed(process, node)
    before = len(process.published(topic))
    node.on_silence("no frames for 1 s; is it live?")
    show_timed(process, node, wait=1.2)
    assert len(process.published(topic)) == before + 1
    # Nor does a new connection to the same server; one to another does.
    node.on_failure("no frames for 10 s")
    node.on_connected("a server")
    show_timed(process, node)
    assert len(process.published(topic)) == before + 2
    node.on_connected("another server")
    show_timed(process, node)
    assert len(process.published(topic)) == before + 2
    assert "/mocap_node: no frames for 1 s; is it live?" in process.logged("warn")


def test_a_machine_whose_clock_is_set_back_is_warned_of():
    process, node = launch()
    show(process, node, body(1))
    handle = node._handle
    before = handle.stamp
    handle.stamp = lambda moment=None: before(moment) - genpy.Duration(3.0)
    show(process, node, body(1))
    (text,) = process.logged("warn")
    assert text == "/mocap_node: this machine's clock was set back by 2.990 s: stamps step back too"
    assert len(process.published("/mocap_node/Robot_1/pose")) == 2


def test_the_configuration_of_natnet():
    _, node = launch()
    assert isinstance(node.source, NatNetSource)
    assert node._parameters.natnet == NatNetParameters()
    config = {
        "server_address": "motive",
        "local_address": "192.168.1.20",
        "multicast_address": "224.0.0.1",
        "command_port": 1520,
        "data_port": 9000,
        "version": [3, 0, 0, 0],
    }
    _, node = launch(optitrack_config=config)
    assert node._parameters.natnet == NatNetParameters(**{**config, "version": "3.0"})


@pytest.mark.parametrize("backend", ["vicon", "qualisys", "vrpn"])
def test_other_systems(backend):
    process, node = launch(backend=backend, motioncapture_config={"hostname": "10.0.0.1"})
    assert isinstance(node.source, LibrarySource)
    assert f"connecting to {backend}" in process.logged("info")[0]


def test_the_shipped_configuration():
    process, node = launch(**yaml.safe_load(SHIPPED.read_text()))
    assert process.logged("warn") == []
    assert node._parameters.natnet == NatNetParameters(multicast_address="224.0.0.1")
    assert isinstance(node.source, NatNetSource)
    show(process, node, body(1), body(2))
    assert len(process.published("/mocap_node/Robot_1/pose")) == 1
    assert len(process.published("/mocap_node/Robot_1/ground_pose")) == 1
    (transform,) = process.published("/tf")[0].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "HY5/base_link")


def test_what_means_nothing_is_warned_of():
    process, _ = launch(rigid_bodies={"1": {"pose": "one", "odom": "Odom"}})
    (text,) = process.logged("warn")
    assert "/mocap_node/rigid_bodies/1/odom is unknown and has no effect" in text


@pytest.mark.parametrize(
    ("changes", "name", "reason"),
    [
        ({"rigid_bodies": {"1": {"pose": 3}}}, "rigid_bodies", "1/pose is 3; expected the name"),
        ({"rigid_bodies": 5}, "rigid_bodies", "expected a dictionary of number or name"),
        ({"backend": "kinect"}, "backend", "expected one of natnet, vicon, qualisys, vrpn"),
        ({"up_axis": "x"}, "up_axis", "expected one of z, y"),
        ({"stale_after": 0}, "stale_after", ">= 0.0001 (s)"),
        ({"backend": "vicon"}, "motioncapture_config/hostname", "is not set"),
        (
            {"optitrack_config": {"multicast_address": "192.168.1.1"}},
            "optitrack_config/multicast_address",
            "expected a multicast address, 224.0.0.0 to 239.255.255.255",
        ),
        (
            {"optitrack_config": {"local_address": "eth0"}},
            "optitrack_config/local_address",
            "expected an IP address",
        ),
        ({"optitrack_config": {"command_port": 0}}, "optitrack_config/command_port", "1 to 65535"),
        ({"optitrack_config": {"version": "new"}}, "optitrack_config/version", "such as 3.1"),
    ],
)
def test_bad_parameters_are_named(changes, name, reason):
    text = refusal({"rigid_bodies": BODIES, **changes})
    assert f"{name} is" in text
    assert reason in text


def test_the_bodies_are_required():
    assert "parameter rigid_bodies is not set; expected it, or single_markers" in refusal({})


class SilentVicon(SilentNode, ViconBridgeNode):
    """vicon_bridge, not connected to anything."""


class SilentVrpn(SilentNode, VrpnClientNode):
    """vrpn_client_node, likewise."""


def test_subjects_of_vicon_are_transforms_of_their_names():
    process, node = FakeProcess(), SilentVicon()
    assert process.launch(node, "/vicon", {"datastream_hostport": "10.0.0.2:801"})
    assert isinstance(node.source, LibrarySource)
    for _ in range(2):
        seen = SeenBody(None, "cf1", (1.0, 2.0, 3.0), TURNED, True)
        show(process, node, seen, body(4, "big drone"))
    message = process.published("/vicon/cf1/cf1")[-1]
    assert (message.header.frame_id, message.child_frame_id) == ("world", "vicon/cf1/cf1")
    assert message.transform.translation.y == 2.0
    assert process.published("/vicon/big_drone/big_drone")
    frames = {each.child_frame_id for each in process.published("/tf")[-1].transforms}
    assert frames == {"vicon/cf1/cf1", "vicon/big drone/big drone"}
    process.advance(1.0)
    (report,) = process.published("/diagnostics")
    assert "vicon: rigid body cf1" in {status.name for status in report.status}


def test_trackers_that_are_not_listed_are_not_published():
    process, node = FakeProcess(), SilentVrpn()
    given = {"server": "10.0.0.1", "trackers": ["cf1"], "broadcast_tf": False}
    assert process.launch(node, "/vrpn_client_node", given)
    show(process, node, SeenBody(None, "cf1", (1.0, 2.0, 3.0), TURNED, True), body(4, "cf2"))
    assert process.published("/vrpn_client_node/cf1/pose")
    assert not process.transport.publishers.keys() & {"/tf", "/vrpn_client_node/cf2/pose"}


def test_a_server_without_a_name_ends_the_client():
    process = FakeProcess()
    assert not process.launch(SilentVrpn(), "/vrpn_client_node", {"server": "", "port": 0})
    (text,) = process.logged("error")
    assert (
        "/vrpn_client_node/server" in text
        and "port is 0; expected an integer from 1 to 65535" in text
    )
