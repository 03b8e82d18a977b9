"""Poses, the supervisor, parameters and packets of one's own, byte by byte."""

import struct

import pytest
from cflib.crazyflie.mem import MemoryElement
from wire_helpers import only_packet

from crazyflie_link.errors import (
    AlreadyLandingError,
    RefusedError,
    UnknownNameError,
    ValueRangeError,
)
from crazyflie_link.subsystem import find_memory, write_memory

NAN = float("nan")


def test_external_pose(target, flying):
    flying.localization.position(1.0, 2.0, 3.0)
    assert only_packet(target, 6, 0) == struct.pack("<fff", 1, 2, 3)
    flying.localization.pose((1.0, 2.0, 3.0), (0.0, 0.0, 3.0, 4.0))
    kind, *numbers = struct.unpack("<B7f", only_packet(target, 6, 1))
    assert kind == 8
    assert numbers == pytest.approx([1, 2, 3, 0, 0, 0.6, 0.8])
    for quaternion in ((0, 0, 0, 0), (0, 0, NAN, 1)):
        with pytest.raises(ValueRangeError):
            flying.localization.pose((0, 0, 0), quaternion)
    for x in (NAN, 1e39):
        with pytest.raises(ValueRangeError):
            flying.localization.position(x, 0, 0)


def test_a_lower_landing_takes_the_place_of_the_one_under_way(target, flying):
    """The vehicle refuses a landing while it lands, but no move."""
    flying.high_level.take_off(1.0, 2.0)
    flying.high_level.land(0.0, 2.0)
    with pytest.raises(AlreadyLandingError):
        flying.high_level.land(-0.5, 1.5)
    target.received.clear()
    flying.high_level.land_lower(-0.5, 1.5)
    go_to = struct.pack("<BBBB5f", 12, 0, 1, 0, 0.0, 0.0, 0.0, 0.0, 1.5)
    land = struct.pack("<BBff?f", 8, 0, -0.5, 0.0, True, 1.5)
    assert target.packets(8, 0) == [go_to, land]
    assert target.flight.is_landing
    for height, duration in ((NAN, 1.5), (-0.5, 0.0)):
        with pytest.raises(ValueRangeError):
            flying.high_level.land_lower(height, duration)


def test_arming_and_the_supervisor(target, flying):
    flying.supervisor.arm()
    flying.supervisor.arm(False)
    flying.supervisor.recover()
    assert target.packets(9, 1) == [b"\x01\x01", b"\x01\x00", b"\x02"]
    target.answers[9, 0, 0x0C] = b"\x8c\x12\x00"
    assert flying.supervisor.read().words() == "armed, flying"
    # 16 bits; what follows is not the state.
    target.answers[9, 0, 0x0C] = b"\x8c\x12\x00\x01"
    assert int(flying.supervisor.read()) == 0x12
    target.answers[9, 1, 1] = b"\x81\x00\x00"
    with pytest.raises(RefusedError, match="arming: .* its state is: armed, flying"):
        flying.supervisor.arm()
    # One byte less says as much; without it nothing is refused.
    target.answers[9, 1, 2] = b"\x82\x00"
    with pytest.raises(RefusedError, match="recovering from a crash: "):
        flying.supervisor.recover()
    target.answers[9, 1, 2] = b"\x82"
    flying.supervisor.recover()


@pytest.mark.filterwarnings("ignore:The supervisor subsystem:UserWarning")
def test_arming_before_protocol_12(make_vehicle, make_link):
    target = make_vehicle(protocol=10)
    link = make_link(target.uri)
    link.connect()
    assert link.supervisor.read() is None
    link.supervisor.arm()
    assert only_packet(target, 13, 0) == b"\x01\x01"
    link.supervisor.recover()
    assert target.wait_for_packets(13, 0, 2)[1] == b"\x02"
    link.supervisor.emergency_stop()
    assert set(target.wait_for_packets(6, 1, 5)) == {b"\x03"}


def test_parameters_are_written_in_their_type(target, flying):
    parameters = flying.parameters
    assert parameters.values() == {
        "cpu.id0": 2**32 - 1,
        "motor.trim": -3,
        "pid_rate.roll_kp": 0.25,
        "ring.effect": 6,
        "sound.freq": 4000,
    }
    assert parameters.write("ring.effect", 7) == 7
    assert parameters.write("pid_rate.roll_kp", 2) == 2.0
    assert parameters.write("motor.trim", -100.0) == -100
    assert target.packets(2, 2) == [
        b"\x00\x00\x07",
        b"\x01\x00" + struct.pack("<f", 2.0),
        b"\x04\x00" + struct.pack("<b", -100),
    ]
    assert parameters.values()["motor.trim"] == -100
    target.parameters["sound.freq"] = ("H", 5000, 0)
    assert parameters.read("sound.freq") == 5000
    assert parameters.types()["cpu.id0"] == ("uint32_t", False)


IMPOSSIBLE_PARAMETERS = [
    ("ring.effect", 256, ValueRangeError),
    ("ring.effect", 1.5, ValueRangeError),
    ("ring.effect", "on", ValueRangeError),
    ("ring.effect", float("inf"), ValueRangeError),
    ("pid_rate.roll_kp", 1e300, ValueRangeError),
    ("cpu.id0", 1, RefusedError),
    ("ring.effekt", 1, UnknownNameError),
    ("ring", 1, UnknownNameError),
]


def test_parameters_that_cannot_be_written(target, flying):
    for name, value, error in IMPOSSIBLE_PARAMETERS:
        with pytest.raises(error, match=name):
            flying.parameters.write(name, value)
    assert target.packets(2, 2) == []


def test_memories(target, flying):
    link = flying.link()
    with pytest.raises(RefusedError, match="no memory for base stations: update its firmware"):
        find_memory(link, MemoryElement.TYPE_LH, "base stations")
    # A reply without a status is not a refusal.
    target.answers[4, 2, 1] = struct.pack("<BI", 1, 0)
    write_memory(link, 1, 0, b"data", "a test")
    assert only_packet(target, 4, 2) == struct.pack("<BI", 1, 0) + b"data"


def test_own_packets(target, flying):
    flying.send_packet(13, 2, b"hello")
    assert only_packet(target, 13, 2) == b"hello"
    flying.send_packet(0, 0, b"lowest")
    flying.send_packet(15, 1, b"highest")
    assert only_packet(target, 0, 0) == b"lowest"
    assert only_packet(target, 15, 1) == b"highest"
    flying.send_packet(13, 3, bytes(30))
    assert only_packet(target, 13, 3) == bytes(30)
    for arguments in ((16, 0, b""), (0, 4, b""), (0, 0, bytes(31))):
        with pytest.raises(ValueRangeError):
            flying.send_packet(*arguments)
