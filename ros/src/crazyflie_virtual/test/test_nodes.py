"""Both nodes on a fake process, with real sockets."""

import socket
import struct

import pytest
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess
from crazyflie_virtual.mocap import is_listed
from crazyflie_virtual.nodes import VirtualCrazyflieNode, VirtualMocapNode

LIMIT = 60.0
QUIET = {"port": 0, "observer/port": 0}


@pytest.fixture
def launch():
    """Return ``launch(node, parameters)``; the nodes are shut down at the end."""
    nodes = []

    def launch(node, parameters):
        process = FakeProcess()
        if process.launch(node, "/node", parameters):
            nodes.append(node)
        return process

    yield launch
    for node in nodes:
        node.shutdown()


def asked(address, request):
    """Return the answer to a datagram; None when none comes."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.settimeout(LIMIT)
        client.sendto(request, address)
        return client.recv(1024)


def test_vehicle_answers(launch):
    node = VirtualCrazyflieNode()
    process = launch(node, {**QUIET, "protocol": 11, "init/x": 2})
    address = node._server.address
    assert asked(address, b"\xdd\x00") == b"\xdd\x00" + struct.pack("<i", 11)
    assert node._server.observe().position == (2.0, 0.0, 0.0)
    assert f"udp://127.0.0.1:{address[1]}" in process.logged("info")[0]


def test_the_true_pose_is_published(launch):
    process = launch(VirtualCrazyflieNode(), {**QUIET, "init/x": 2, "topics/true_pose": "/true"})
    process.advance(0.1)
    pose = process.published("/true")[-1].pose
    assert (pose.position.x, pose.orientation.w) == (2.0, 1.0)


def test_what_moves_is_where_tf_says(launch, tmp_path):
    file = tmp_path / "room.yaml"
    file.write_text(
        "floor: {size: [4, 4]}\n"
        "objects:\n"
        "  - type: ball\n"
        "    name: ball\n"
        "    radius: 0.1\n"
        "    path: {type: circle, centre: [0, 0, 1], radius: 1, period: 9}\n"
    )
    node = VirtualCrazyflieNode()
    process = launch(node, {**QUIET, "world": str(file)})
    process.advance(0.1)
    assert node._server.vehicle.physics.world["ball"].centre == (1.0, 0.0, 1.0)
    transform = TransformStamped(child_frame_id="ball")
    transform.header.frame_id = "world"
    transform.header.stamp = process.handle("/other").stamp()
    transform.transform.translation.x = 3.0
    transform.transform.rotation.w = 1.0
    process.publish("/tf", TFMessage([transform]))
    process.advance(0.1)
    assert node._server.vehicle.physics.world["ball"].centre == (3.0, 0.0, 0.0)


def test_a_bad_world_ends_it(launch):
    process = launch(VirtualCrazyflieNode(), {**QUIET, "world": "/nowhere/room.yaml"})
    assert "/nowhere/room.yaml: cannot be read" in process.logged("error")[0]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("positioning", "gps"),
        ("fault/loss", 2.0),
    ],
)
def test_bad_parameters_are_named(launch, name, value):
    process = launch(VirtualCrazyflieNode(), {**QUIET, name: value})
    assert f"/node/{name} is" in process.logged("error")[0]
    assert "expected" in process.logged("error")[0]


def test_a_port_that_is_taken_is_named(launch):
    node = VirtualCrazyflieNode()
    launch(node, QUIET)
    port = node._server.address[1]
    process = launch(VirtualCrazyflieNode(), {**QUIET, "port": port})
    assert f"127.0.0.1:{port}: Address already in use" in process.logged("error")[0]


def test_switches_may_be_changed_while_it_runs(launch):
    node = VirtualCrazyflieNode()
    process = launch(node, {**QUIET, "fault/loss": 0.25})
    faults = node._server.switches
    assert faults.loss == 0.25
    process.transport.set_param("/node/fault", {"loss": 0.25, "motor_failure": 3})
    process.advance(1.0)
    assert (faults.loss, faults.motor_failure) == (0.25, 3)
    # Values that a client has set meanwhile are kept.
    faults.delay = 0.1
    process.advance(1.0)
    assert faults.delay == 0.1


def test_a_bad_switch_is_named_and_changes_nothing(launch):
    node = VirtualCrazyflieNode()
    process = launch(node, QUIET)
    process.transport.set_param("/node/fault/loss", "a lot")
    process.advance(1.0)
    assert process.logged("warn") == [
        "/node: parameter /node/fault/loss is 'a lot'; expected a finite number >= 0 and <= 1"
    ]
    assert node._server.switches.loss == 0.0


def test_switches_are_live(launch):
    node = VirtualCrazyflieNode()
    process = launch(node, QUIET)
    faults = node._server.switches
    process.reconfigure("/node", **{"fault/loss": 0.25, "fault/low_battery": True})
    assert (faults.loss, faults.low_battery) == (0.25, True)
    process.transport.set_param("/node/fault/loss", 0.5)
    process.advance(1.0)
    process.reconfigure("/node", **{"fault/motor_failure": 3})
    assert (faults.loss, faults.motor_failure) == (0.5, 3)


def test_a_silence_that_is_set_once_is_not_prolonged(launch):
    node = VirtualCrazyflieNode()
    process = launch(node, QUIET)
    process.reconfigure("/node", **{"fault/silence": 1000.0})
    node._server.switches.silence = 500.0
    process.advance(1.0)
    assert node._server.switches.silence <= 500.0


def test_a_bad_change_is_refused(launch):
    node = VirtualCrazyflieNode()
    process = launch(node, QUIET)
    with pytest.raises(ServiceError, match="/node/fault/motor_failure is 5; expected an integer"):
        process.reconfigure("/node", **{"fault/motor_failure": 5})
    assert node._server.switches.motor_failure == 0


def test_mocap_answers(launch):
    node = VirtualMocapNode()
    parameters = {"command_port": 0, "observer/port": 0, "version": "4.1", "fault/invalid": "3"}
    process = launch(node, parameters)
    answer = asked(node._server.address, struct.pack("<HH", 0, 0))
    assert struct.unpack_from("<H", answer) == (1,)
    assert answer[264:266] == b"\4\1"
    assert is_listed(3, node._server.switches.invalid)
    process.transport.set_param("/node/fault", {"invalid": "", "silent": True})
    process.advance(1.0)
    assert not is_listed(3, node._server.switches.invalid)
    assert node._server.switches.silent
    process.reconfigure("/node", **{"fault/invalid": "all"})
    assert is_listed(3, node._server.switches.invalid)
