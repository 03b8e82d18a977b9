"""Services of a vehicle, down to the bytes on the link."""

import struct
from concurrent.futures import ThreadPoolExecutor
from itertools import groupby

import pytest
from genpy import Duration
from geometry_msgs.msg import Point, Twist, Vector3
from safety_helpers import HIGH_LEVEL, is_
from std_srvs.srv import EmptyRequest, SetBoolRequest

from crazyflie_driver.msg import TrajectoryPolynomialPiece, crtpPacket
from crazyflie_driver.srv import (
    GoToRequest,
    LandRequest,
    NotifySetpointsStopRequest,
    SetGroupMaskRequest,
    StartTrajectoryRequest,
    StopRequest,
    TakeoffRequest,
    UpdateParamsRequest,
    UploadTrajectoryRequest,
    sendPacketRequest,
)
from crazyflie_model.limits import OFF_AGE
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.peer import wait_until

LIMIT = 60.0
SETPOINTS_STOP = struct.pack("<BI", 0, 0)
TAKEOFF = TakeoffRequest(1, 1.5, Duration(2, 500_000_000))


def test_high_level_commands(flying):
    server, vehicle = flying
    call = server.call
    call("/cf1/set_group_mask", SetGroupMaskRequest(3))
    call("/cf1/takeoff", TAKEOFF)
    call("/cf1/go_to", GoToRequest(2, True, Point(1.0, -2.0, 0.5), 0.75, Duration(4)))
    piece = TrajectoryPolynomialPiece(duration=Duration(1))
    call("/cf1/upload_trajectory", UploadTrajectoryRequest(5, 0, [piece]))
    call("/cf1/start_trajectory", StartTrajectoryRequest(4, 5, 1.5, True, False))
    call("/cf1/land", LandRequest(0, 0.25, Duration(3)))
    call("/cf1/stop", StopRequest(7))
    assert vehicle.packets(8, 0) == [
        b"\x00\x03",
        struct.pack("<BBff?f", 7, 1, 1.5, 0.0, True, 2.5),
        struct.pack("<4B5f", 12, 2, 1, 0, 1.0, -2.0, 0.5, 0.75, 4.0),
        struct.pack("<4BIB", 6, 5, 1, 0, 0, 1),
        struct.pack("<6Bf", 13, 4, 0, 0, 1, 5, 1.5),
        struct.pack("<BBff?f", 8, 0, 0.25, 0.0, True, 3.0),
        b"\x03\x07",
    ]


def test_setpoints_are_handed_over_before_a_high_level_command(server, vehicle):
    def sent():
        ports = [(port, channel) for port, channel, _ in vehicle.received if port in (3, 7, 8)]
        vehicle.received.clear()
        return ports

    # The zeros after connecting have been handed over.
    server.call("/cf1/takeoff", TAKEOFF)
    assert sent() == [(8, 0)]
    server.process.advance(1.0)
    server.process.publish("/cf1/cmd_vel", Twist(Vector3(0, 0, 1.0), Vector3()))
    vehicle.wait_for_packets(3, 0)
    server.call("/cf1/land", LandRequest(0, 0.0, Duration(2)))
    assert sent() == [(3, 0), (7, 1), (8, 0)]


def test_setpoints_that_override_a_command_are_pointed_out(flying):
    server, vehicle = flying
    server.call("/cf1/takeoff", TAKEOFF)
    server.process.advance(1.0)
    server.process.publish("/cf1/cmd_vel", Twist(Vector3(0, 0, 1.0), Vector3()))
    assert "cmd_vel overrides the high-level command" in server.process.logged("warn")[0]


def test_notify_setpoints_stop(server, vehicle):
    server.call("/cf1/notify_setpoints_stop", NotifySetpointsStopRequest(0, 250))
    assert vehicle.wait_for_packets(7, 1) == [struct.pack("<BI", 0, 250)]


def test_a_takeoff_arms_a_vehicle_that_is_not(flying):
    server, vehicle = flying
    # No setpoint of another test counts any more.
    server.process.advance(OFF_AGE + 0.1)
    vehicle.answers[9, 0, 0x0C] = b"\x8c\x01\x00"

    def spin_up():
        vehicle.wait_for_packets(9, 1)
        assert vehicle.packets(8, 0) == []
        vehicle.answers[9, 0, 0x0C] = b"\x8c\x0a\x00"

    with ThreadPoolExecutor() as pool:
        spun_up = pool.submit(spin_up)
        server.call("/cf1/takeoff", TAKEOFF)
        spun_up.result(LIMIT)
    assert vehicle.packets(9, 1) == [b"\x01\x01"]
    assert len(vehicle.packets(8, 0)) == 1


def test_a_vehicle_that_does_not_spin_up_does_not_take_off(flying):
    server, vehicle = flying
    server.process.advance(OFF_AGE + 0.1)
    vehicle.answers[9, 0, 0x0C] = b"\x8c\x01\x00"
    with pytest.raises(
        ServiceError, match="armed, and cannot fly within 2 s: see that each motor .* is: can be"
    ):
        server.call("/cf1/takeoff", TAKEOFF)
    assert vehicle.packets(8, 0) == []


def test_a_vehicle_that_cannot_fly_does_not_take_off(flying):
    server, vehicle = flying
    vehicle.answers[9, 0, 0x0C] = b"\x8c\x82\x00"
    with pytest.raises(ServiceError, match="cannot fly, its state is: armed, crashed"):
        server.call("/cf1/takeoff", TAKEOFF)
    assert vehicle.packets(8, 0) == []
    assert "cf1: takeoff failed" in server.process.logged("error")[0]


def test_a_refused_command_is_a_failed_call(flying):
    server, vehicle = flying
    is_(vehicle, HIGH_LEVEL)
    vehicle.answers[8, 0, 8] = b"\x08\x00\x00\x16"
    with pytest.raises(ServiceError, match="land command: the vehicle refuses it"):
        server.call("/cf1/land", LandRequest(0, 0.0, Duration(2)))


def test_a_command_without_reply_is_a_failed_call(flying):
    server, vehicle = flying
    is_(vehicle, HIGH_LEVEL)
    vehicle.deaf.add((8, 0, b""))
    with pytest.raises(ServiceError, match="has not replied within 1 s"):
        server.call("/cf1/land", LandRequest(0, 0.0, Duration(2)))


def test_arming(flying):
    server, vehicle = flying
    server.process.advance(OFF_AGE + 0.1)
    assert server.call("/cf1/arm", SetBoolRequest(True)).success
    assert server.call("/cf1/arm", SetBoolRequest(False)).message == "disarmed"
    # A busy machine may repeat a request before its answer is read.
    assert [data for data, _ in groupby(vehicle.packets(9, 1))] == [b"\x01\x01", b"\x01\x00"]
    vehicle.answers[9, 1, 1] = b"\x81\x00\x00"
    answer = server.call("/cf1/arm", SetBoolRequest(True))
    assert not answer.success
    assert "the vehicle refuses it" in answer.message


def test_an_emergency_is_latched(server, vehicle):
    server.call("/cf1/emergency", EmptyRequest())
    assert vehicle.wait_for_packets(9, 1)[0] == b"\x03"
    vehicle.wait_for_packets(7, 0)
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    assert crazyflie.supervisor.wait_for_emergency_stop(LIMIT)
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 2)
    vehicle.received.clear()
    server.process.publish("/cf1/cmd_vel", Twist(Vector3(0, 0, 1000.0), Vector3()))
    for service, request in (
        ("takeoff", TAKEOFF),
        ("go_to", GoToRequest(duration=Duration(1))),
        ("start_trajectory", StartTrajectoryRequest(timescale=1.0)),
    ):
        with pytest.raises(ServiceError, match="emergency stop: remove"):
            server.call(f"/cf1/{service}", request)
    assert not server.call("/cf1/arm", SetBoolRequest(True)).success
    vehicle.wait_for_packets(15, 0, 3)
    assert {port for port, _, _ in vehicle.received} <= {15}
    assert any("ignoring cmd_vel: emergency stop" in t for t in server.process.logged("warn"))
    server.process.advance(1.0)
    (status,) = server.process.published("/diagnostics")[-1].status
    assert status.message.startswith("emergency stop")
    # Only a vehicle that is added again flies again.
    server.remove(vehicle.uri)
    vehicle.flight.restart()
    server.add(vehicle.uri)
    server.call("/cf1/takeoff", TAKEOFF)


def test_an_emergency_without_a_link_is_sent_when_it_is_back(server, vehicle):
    vehicle.is_frozen = True
    wait_until(lambda: server.process.logged("error"), "the loss")
    with pytest.raises(ServiceError, match="is sent when the link is back"):
        server.call("/cf1/emergency", EmptyRequest())
    vehicle.received.clear()
    vehicle.is_frozen = False
    assert vehicle.wait_for_packets(9, 1)[0] == b"\x03"
    assert vehicle.packets(3, 0) == []


def test_trajectories(flying):
    server, vehicle = flying
    piece = TrajectoryPolynomialPiece(
        [0.0, 1.0], [], [0.5], [0.0, 0.0, 2.0], Duration(1, 500_000_000)
    )
    server.call("/cf1/upload_trajectory", UploadTrajectoryRequest(3, 1, [piece, piece]))
    memory = bytearray(4096)
    for data in vehicle.packets(4, 2):
        (address,) = struct.unpack_from("<I", data, 1)
        memory[address : address + len(data) - 5] = data[5:]
    x, y, z, yaw = [0.0, 1.0], [], [0.5], [0.0, 0.0, 2.0]
    numbers = [value for axis in (x, y, z, yaw) for value in axis + [0.0] * (8 - len(axis))]
    assert memory[132:396] == struct.pack("<33f", *numbers, 1.5) * 2
    assert vehicle.packets(8, 0) == [struct.pack("<4BIB", 6, 3, 1, 0, 132, 2)]
    with pytest.raises(ServiceError, match="room for 31"):
        server.call("/cf1/upload_trajectory", UploadTrajectoryRequest(3, 30, [piece, piece]))


def test_own_packets(flying):
    server, vehicle = flying
    data = bytes(range(30))
    server.call("/cf1/send_packet", sendPacketRequest(crtpPacket(3, 0xD2, data)))
    assert vehicle.wait_for_packets(13, 2) == [b"\x00\x01\x02"]
    server.call("/cf1/send_packet", sendPacketRequest(crtpPacket(30, 0xDF, data)))
    assert vehicle.wait_for_packets(13, 3) == [data]
    with pytest.raises(ServiceError, match="size is 31"):
        server.call("/cf1/send_packet", sendPacketRequest(crtpPacket(31, 0xD2, data)))


def test_parameters(server):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri, enable_parameters=True)
    parameters = server.process.transport.parameters
    assert parameters["/cf1/ring/effect"] == 6
    assert parameters["/cf1/pid_rate/roll_kp"] == 0.25
    assert parameters["/cf1/motor/trim"] == -3
    # More than XML-RPC's integers can hold.
    assert parameters["/cf1/cpu/id0"] == 4294967295.0
    assert isinstance(parameters["/cf1/cpu/id0"], float)
    parameters.update({"/cf1/ring/effect": 7, "/cf1/pid_rate/roll_kp": 2, "/cf1/motor/trim": True})
    names = ["ring/effect", "/pid_rate/roll_kp", "motor.trim"]
    server.call("/cf1/update_params", UpdateParamsRequest(names))
    assert vehicle.packets(2, 2) == [
        b"\x00\x00\x07",
        b"\x01\x00" + struct.pack("<f", 2.0),
        b"\x03\x00\x01",
    ]
    assert parameters["/cf1/pid_rate/roll_kp"] == 2.0


def test_parameters_that_cannot_be_written_do_not_stop_the_others(server):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri, enable_parameters=True)
    server.process.transport.parameters.update({"/cf1/ring/effect": 1000, "/cf1/motor/trim": 5})
    server.process.transport.parameters["/cf1/no/such"] = 1
    names = ["ring/effect", "no/such", "not/set", "nonsense", "cpu/id0", "motor/trim"]
    with pytest.raises(ServiceError) as caught:
        server.call("/cf1/update_params", UpdateParamsRequest(names))
    for text in (
        "ring.effect is a uint8_t; 1000 does not fit",
        "no parameter 'no.such'",
        "parameter /cf1/not/set is not set",
        "'nonsense' is not a firmware parameter; expected GROUP/NAME",
        "cpu.id0 can only be read",
    ):
        assert text in str(caught.value)
    assert vehicle.packets(2, 2) == [b"\x03\x00\x05"]


def test_texts_are_numbers_or_the_firmware_s_values_again(server):
    """``rosparam set`` sets texts for 1e-3 and 0x1g."""
    vehicle = server.make_vehicle()
    server.add(vehicle.uri, enable_parameters=True)
    parameters = server.process.transport.parameters
    before = dict(parameters)
    parameters["/cf1/pid_rate/roll_kp"] = "1e-3"
    bad = {"/cf1/ring/effect": "0x1g", "/cf1/motor/trim": 1000, "/cf1/cpu/id0": "1"}
    parameters.update(bad)
    names = [name.removeprefix("/cf1/") for name in parameters if parameters[name] != before[name]]
    with pytest.raises(
        ServiceError, match="parameter /cf1/ring/effect is '0x1g'; expected a finite"
    ):
        server.call("/cf1/update_params", UpdateParamsRequest(names))
    assert vehicle.packets(2, 2) == [b"\x01\x00" + struct.pack("<f", 1e-3)]
    assert parameters["/cf1/pid_rate/roll_kp"] == pytest.approx(1e-3)
    assert {name: parameters[name] for name in bad} == {name: before[name] for name in bad}


def test_without_parameters_there_are_none(flying):
    server, vehicle = flying
    assert server.process.transport.parameters == {}


def test_only_a_radio_can_reboot(flying):
    server, vehicle = flying
    assert "/cf1/reboot" not in server.process.transport.services
