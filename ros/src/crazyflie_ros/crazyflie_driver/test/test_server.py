"""Adding and removing vehicles, and loss of the link."""

import struct

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from genpy import Duration
from geometry_msgs.msg import Twist, Vector3

from crazyflie_driver.srv import TakeoffRequest
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.peer import wait_until
from crazyflie_utils.testing.programs import free_port

LIMIT = 60.0
ZERO = struct.pack("<fffH", 0, 0, 0, 0)


def status(server, name="cf1"):
    server.process.advance(1.0)
    (found,) = [
        each
        for each in server.process.published("/diagnostics")[-1].status
        if each.name == f"crazyflie_server: {name}"
    ]
    return found


def test_a_hundred_zeros_after_connecting_and_before_leaving(server):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    assert vehicle.packets(3, 0) == [ZERO] * 100
    server.remove(vehicle.uri)
    assert vehicle.wait_for_packets(3, 0, 200) == [ZERO] * 200


def test_zeros_are_not_sent_to_a_vehicle_that_flies(server):
    vehicle = server.make_vehicle()
    vehicle.answers[9, 0, 0x0C] = b"\x8c\x1a\x00"
    server.add(vehicle.uri)
    assert vehicle.packets(3, 0) == []
    assert "may be flying" in server.process.logged("warn")[0]


def test_many_vehicles_and_one_that_is_stuck(server):
    stuck = server.make_vehicle()
    stuck.deaf.add((4, 0, b""))
    good = [server.make_vehicle() for _ in range(3)]
    failing = server.begin_adding(stuck.uri, "stuck")
    adding = [server.begin_adding(v.uri, f"cf{k}") for k, v in enumerate(good)]
    for answer in adding:
        answer.result(timeout=LIMIT)
    assert not failing.done()
    for k, vehicle in enumerate(good):
        server.process.publish(f"/cf{k}/cmd_vel", Twist())
        vehicle.wait_for_packets(3, 0, 101)
        vehicle.received.clear()
        server.process.publish(f"/cf{k}/cmd_vel", Twist(Vector3(0, 0, 1000.0 + k), Vector3()))
        assert struct.unpack_from("<H", vehicle.wait_for_packets(3, 0)[0], 12) == (1000 + k,)
    with pytest.raises(ServiceError, match="the connection is stuck"):
        failing.result(timeout=LIMIT)
    # Nothing remains of it.
    stuck.deaf.clear()
    server.add(stuck.uri, "stuck")


@pytest.mark.parametrize(
    ("uri", "text"),
    [
        ("radio://0/25/2M/E7E7E7E701", "no Crazyradio dongle found.*udev"),
        ("radio://0/25", "is not an address of a vehicle: expected radio://"),
        ("udp://127.0.0.1:1", "nothing listens on this port"),
    ],
)
def test_errors_that_an_operator_can_act_on(make_server, uri, text):
    server = make_server({"connect/limit": 0.5})
    with pytest.raises(ServiceError, match=text):
        server.add(uri)
    assert any(uri in line for line in server.process.logged("error"))


def test_a_vehicle_whose_port_opens_a_little_later(server):
    port = free_port()
    answer = server.begin_adding(f"udp://127.0.0.1:{port}")
    wait_until(lambda: "nothing listens" in status(server).message, "a failed attempt")
    assert not answer.done()
    server.make_vehicle(port=port)
    answer.result(timeout=LIMIT)
    assert server.process.logged("error") == []


def test_a_silent_port(make_server):
    server = make_server({"connect/limit": 0.0})
    vehicle = server.make_vehicle()
    vehicle.is_frozen = True
    with pytest.raises(ServiceError, match="no answer has come within 2 s"):
        server.add(vehicle.uri)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"prefix": "my vehicle"}, "tf_prefix is 'my vehicle'"),
        ({"roll_trim": float("nan")}, "roll_trim is nan"),
        ({"prefix": "my vehicle", "pitch_trim": float("inf")}, "tf_prefix is .*pitch_trim is inf"),
    ],
)
def test_requests_that_make_no_sense(server, changes, text):
    vehicle = server.make_vehicle()
    with pytest.raises(ServiceError, match=text):
        server.add(vehicle.uri, **changes)
    assert vehicle.received == []


def test_nothing_is_added_twice(server, vehicle):
    with pytest.raises(ServiceError, match="has been added already, as cf1"):
        server.add(vehicle.uri, "cf2")
    with pytest.raises(ServiceError, match="tf_prefix 'cf1' is in use"):
        server.add("udp://127.0.0.1:1", " /cf1/\n")


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("udp://127.0.0.1:{}", "udp://localhost:{}"),
        ("udp://localhost:{}", "udp://127.0.0.1:{}"),
        ("udp://127.0.0.1:{}", "udp://127.1:{}"),
    ],
)
def test_no_vehicle_is_added_twice_under_two_spellings(server, first, second):
    """Two links would displace each other, and nobody would feed its watchdog."""
    vehicle = server.make_vehicle()
    first, second = first.format(vehicle.port), second.format(vehicle.port)
    server.add(first)
    with pytest.raises(ServiceError, match=f"{second} has been added already, as cf1 .{first}.$"):
        server.add(second, "cf2")
    # Any spelling removes it.
    server.remove(second)
    server.add(second, "cf2")


@pytest.mark.parametrize(
    "second",
    [
        "radio://0/80/2M/e7e7e7e7e7",
        "radio://0/80/2M/E7E7E7E7E7?safelink=0",
        "radio://1/80/2M/E7E7E7E7E7",
        "radio://0/80/2M",
        "radio://0/080/2M/E7E7E7E7E7",
    ],
)
def test_no_radio_is_added_twice_under_two_spellings(server, second):
    # There is no dongle: the first one is tried until the end of the test.
    adding = server.begin_adding("radio://0/80/2M/E7E7E7E7E7")
    with pytest.raises(ServiceError, match="has been added already, as cf1"):
        server.add(second, "cf2")
    with pytest.raises(ServiceError, match="no Crazyradio dongle found"):
        adding.result(timeout=LIMIT)


def test_without_a_prefix_everything_is_at_the_root(server):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri, "", enable_logging=True, enable_logging_imu=True)
    transport = server.process.transport
    assert {"/takeoff", "/emergency"} < set(transport.services)
    assert {"/rssi", "/imu"} < set(transport.publishers)
    vehicle.received.clear()
    server.process.publish("/cmd_vel", Twist(Vector3(0, 0, 1000.0), Vector3()))
    assert len(vehicle.wait_for_packets(3, 0)) == 1
    wait_until(lambda: server.process.published("/imu"), "the imu")
    assert server.process.published("/imu")[0].header.frame_id == "base_link"
    assert status(server, vehicle.uri).level == DiagnosticStatus.OK
    with pytest.raises(ServiceError, match="tf_prefix '' is in use"):
        server.add("udp://127.0.0.1:1", "/")


def test_a_vehicle_that_is_removed_leaves_nothing_and_can_come_again(server, vehicle):
    transport = server.process.transport
    services = set(transport.services)
    assert all(transport.subscribers.values())
    server.remove(vehicle.uri)
    of_all = {name for name in transport.services if name.startswith("/crazyflie_server/all/")}
    assert set(transport.services) - of_all == {"/add_crazyflie", "/remove_crazyflie"}
    heard = {topic for topic, listeners in transport.subscribers.items() if listeners}
    assert heard == {"/clock", "/all/emergency", "/flights"}
    with pytest.raises(ServiceError, match="known: none"):
        server.remove(vehicle.uri)
    server.add(vehicle.uri)
    assert set(transport.services) == services


def test_a_vehicle_can_be_removed_while_it_is_connecting(server):
    vehicle = server.make_vehicle()
    vehicle.deaf.add((5, 0, b""))
    adding = server.begin_adding(vehicle.uri)
    vehicle.wait_for_packets(5, 0)
    server.remove(vehicle.uri)
    with pytest.raises(ServiceError, match="closed"):
        adding.result(timeout=LIMIT)


def test_a_link_that_is_lost_and_comes_back(server, vehicle):
    assert status(server).level == DiagnosticStatus.OK
    vehicle.is_frozen = True
    wait_until(lambda: status(server).level == DiagnosticStatus.ERROR, "the loss")
    assert "has not been heard" in status(server).message
    wait_until(lambda: server.process.logged("error"), "the message about the loss")
    assert "trying to connect again" in server.process.logged("error")[0]
    server.process.publish("/cf1/cmd_vel", Twist(Vector3(0, 0, 1000.0), Vector3()))
    assert any(
        "ignoring cmd_vel: the link is lost" in text for text in server.process.logged("warn")
    )
    with pytest.raises(ServiceError, match="no link to the vehicle"):
        server.call("/cf1/takeoff", TakeoffRequest(0, 1.0, Duration(2)))
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    wait_until(lambda: crazyflie._opening is not None, "a new attempt to connect")
    vehicle.is_frozen = False
    wait_until(lambda: status(server).level == DiagnosticStatus.OK, "the link's return")
    # The vehicle stands: its thrust lock is opened again on the new link.
    wait_until(lambda: vehicle.packets(3, 0).count(ZERO) == 100, "zeros")
    server.call("/cf1/takeoff", TakeoffRequest(0, 1.0, Duration(2)))


def test_diagnostics_tell_what_an_operator_needs(server, vehicle):
    wait_until(lambda: values(server)["battery (V)"] != "unknown", "the battery")
    found = values(server)
    assert status(server).hardware_id == vehicle.uri
    assert found["battery (V)"] == "3.75"
    assert found["rssi (-dBm)"] == "47"
    assert found["state"] == "armed, auto armed, can fly, trajectory finished"
    assert found["link"] == "connected"
    assert float(found["link quality (%)"]) > 50.0
    assert found["findings"] == "none"


def values(server):
    return {each.key: each.value for each in status(server).values}


def test_the_end_of_the_server_stops_all_motors(server):
    vehicles = [server.make_vehicle() for _ in range(3)]
    for k, vehicle in enumerate(vehicles):
        server.add(vehicle.uri, f"cf{k}")
        # The packet that ends the zero thrust after connecting.
        vehicle.wait_for_packets(7, 1)
        vehicle.received.clear()
    process, node = server.process, server.node
    process.shut_down({"/crazyflie_server": node})
    for vehicle in vehicles:
        assert vehicle.wait_for_packets(3, 0, 100) == [ZERO] * 100


def test_a_vehicle_that_does_not_tell_its_state_is_stopped_if_its_log_has_it_on_the_ground(server):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    vehicle.wait_for_packets(7, 1)
    vehicle.received.clear()
    vehicle.deaf.add((9, 0, b"\x0c"))
    server.remove(vehicle.uri)
    assert vehicle.wait_for_packets(3, 0, 100) == [ZERO] * 100
