"""Both nodes on a fake process, with real sockets."""

import socket
import struct

import pytest

from crazyflie_utils.testing import FakeProcess
from crazyflie_virtual.mocap.mocap_node import VirtualMocapNode
from crazyflie_virtual.vehicle_node import VirtualCrazyflieNode

LIMIT = 10.0
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


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("port", 70000),
        ("port", "many"),
        ("init/x", float("nan")),
        ("positioning", "gps"),
        ("auto_arm", 1),
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
    process.transport.parameters["/node/fault"] = {"loss": 0.25, "motor_failure": 3}
    process.advance(1.0)
    assert (faults.loss, faults.motor_failure) == (0.25, 3)
    # What a client has set meanwhile stays.
    faults.delay = 0.1
    process.advance(1.0)
    assert faults.delay == 0.1


@pytest.mark.parametrize(
    ("switches", "text"),
    [
        ({"loss": "a lot"}, "loss must be a finite number"),
        ({"wings": 1}, "there is no switch wings"),
    ],
)
def test_bad_switches_are_told_and_change_nothing(launch, switches, text):
    node = VirtualCrazyflieNode()
    process = launch(node, QUIET)
    process.transport.parameters["/node/fault"] = switches
    process.advance(1.0)
    assert text in process.logged("warn")[0]
    assert node._server.switches.loss == 0.0


def test_mocap_answers(launch):
    node = VirtualMocapNode()
    parameters = {"command_port": 0, "observer/port": 0, "version": "4.1", "fault/invalid": "3"}
    process = launch(node, parameters)
    answer = asked(node._server.address, struct.pack("<HH", 0, 0))
    assert struct.unpack_from("<H", answer) == (1,)
    assert answer[264:266] == b"\4\1"
    assert node._server.switches.hides(3)
    process.transport.parameters["/node/fault"] = {"invalid": "", "silent": True}
    process.advance(1.0)
    assert not node._server.switches.hides(3)
    assert node._server.switches.silent
