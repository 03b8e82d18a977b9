"""Every setpoint and high-level command that goes to the vehicle, byte by byte."""

import struct
import threading

import numpy as np
import pytest
from cflib.crazyflie.mem import Poly4D
from wire_helpers import only_packet

from crazyflie_link.errors import RefusedError, ValueRangeError
from crazyflie_model.polynomials import PIECE_SIZE, PolynomialPiece

NAN = float("nan")


def test_attitude_setpoint_has_its_pitch_negated(target, flying):
    flying.setpoints.attitude(1.5, 10.0, -20.0, 42000)
    assert only_packet(target, 3, 0) == struct.pack("<fffH", 1.5, -10.0, -20.0, 42000)


@pytest.mark.parametrize("protocol", [8, 12])
def test_generic_setpoints_are_those_of_crazyflie_cpp(make_vehicle, make_link, protocol):
    target = make_vehicle(protocol=protocol)
    link = make_link(target.uri)
    link.connect()
    numbers = (0.5, -0.25, 0.125, 30.0)
    calls = [
        (
            link.setpoints.velocity_world,
            numbers,
            struct.pack("<Bffff", 1, 0.5, -0.25, 0.125, 30.0),
        ),
        (
            link.setpoints.hover,
            (0.5, -0.25, 30.0, 1.5),
            struct.pack("<Bffff", 5, 0.5, -0.25, 30.0, 1.5),
        ),
        (
            link.setpoints.position,
            (0.5, -0.25, 1.0, 90.0),
            struct.pack("<Bffff", 7, 0.5, -0.25, 1.0, 90.0),
        ),
        (link.setpoints.stop, (), b"\0"),
    ]
    for count, (call, arguments, data) in enumerate(calls, start=1):
        call(*arguments)
        assert target.wait_for_packets(7, 0, count)[-1] == data


def decompressed(number):
    """Return the quaternion (x, y, z, w) of the firmware's 32 bits (its quatcompress.h).

    Two bits name the largest component, which is positive; of the others, in their
    order, 10 bits each: sign and magnitude in units of sqrt(1/2) / 511.
    """
    largest = number >> 30
    quaternion = np.zeros(4)
    shift = 20
    for index in range(4):
        if index != largest:
            bits = number >> shift & 0x3FF
            size = (bits & 0x1FF) / 511.0 * np.sqrt(0.5)
            quaternion[index] = -size if bits >> 9 else size
            shift -= 10
    quaternion[largest] = np.sqrt(1.0 - quaternion @ quaternion)
    return quaternion


def test_full_state_setpoint_is_in_thousandths_and_its_rates_in_milliradians(target, flying):
    quaternion = np.array([0.1, -0.2, 0.3, 0.9])
    flying.setpoints.full_state(
        (1.25, -2.5, 0.5), (0.5, 0.25, -0.125), (0.0, 0.0, 9.75), quaternion, (0.5, -1.0, 2.0)
    )
    kind, *numbers = struct.unpack("<B9hI3h", only_packet(target, 7, 0))
    assert kind == 6
    assert numbers[:9] == [1250, -2500, 500, 500, 250, -125, 0, 0, 9750]
    assert numbers[10:] == [500, -1000, 2000]
    np.testing.assert_allclose(
        decompressed(numbers[9]), quaternion / np.linalg.norm(quaternion), atol=2e-3
    )


def test_notify_setpoints_stop_takes_the_place_of_the_setpoint_that_waits(target, flying):
    entered, free = threading.Event(), threading.Event()

    def block():
        entered.set()
        free.wait(30.0)

    flying.link().put(block)
    assert entered.wait(30.0)
    flying.setpoints.position(0.0, 0.0, 1.0, 0.0)
    flying.setpoints.notify_setpoints_stop(1500)
    free.set()
    assert only_packet(target, 7, 1) == struct.pack("<BI", 0, 1500)
    # A setpoint that waited would be sent next.
    target.wait_for_packets(15, 0, len(target.packets(15, 0)) + 2)
    assert target.packets(7, 0) == []


def test_a_hundred_zeros(target, flying):
    flying.setpoints.send_zero_thrust()
    assert target.wait_for_packets(3, 0, 100) == [struct.pack("<fffH", 0, 0, 0, 0)] * 100


IMPOSSIBLE_SETPOINTS = [
    lambda s: s.attitude(NAN, 0, 0, 0),
    lambda s: s.attitude(0, 0, 0, -1),
    lambda s: s.attitude(0, 0, 0, 65536),
    lambda s: s.velocity_world(0, 0, float("inf"), 0),
    lambda s: s.hover(0, 0, 0, NAN),
    lambda s: s.position(0, NAN, 0, 0),
    lambda s: s.full_state((40, 0, 0), (0,) * 3, (0,) * 3, (0, 0, 0, 1), (0,) * 3),
    lambda s: s.full_state((NAN, 0, 0), (0,) * 3, (0,) * 3, (0, 0, 0, 1), (0,) * 3),
    lambda s: s.full_state((0,) * 3, (0,) * 3, (0,) * 3, (0, 0, 0, 0), (0,) * 3),
    lambda s: s.notify_setpoints_stop(-1),
    # Beyond single precision.
    lambda s: s.attitude(1e39, 0, 0, 0),
    lambda s: s.attitude(0, -1e300, 0, 0),
    lambda s: s.velocity_world(0, 0, 3.5e38, 0),
    lambda s: s.hover(0, 0, 0, 1e39),
    lambda s: s.position(0, 0, 0, -1e39),
    lambda s: s.full_state((0,) * 3, (0,) * 3, (0,) * 3, (1e300, 0, 0, 1e300), (0,) * 3),
]


def test_numbers_that_cannot_be_flown_are_not_only_packet(target, flying):
    for send in IMPOSSIBLE_SETPOINTS:
        with pytest.raises(ValueRangeError):
            send(flying.setpoints)
    flying.setpoints.position(0, 0, 1, 0)
    assert len(target.wait_for_packets(7, 0)) == 1
    assert target.packets(3, 0) == []


def test_high_level_commands(target, flying):
    high = flying.high_level
    high.set_group_mask(3)
    high.take_off(1.5, 2.0, group_mask=1)
    high.land(0.25, 3.0)
    high.go_to((1.0, -2.0, 0.5), 0.75, 4.0, relative=True, group_mask=2)
    high.define_trajectory(5, range(264, 660), 3)
    high.start_trajectory(5, 1.5, relative=True, is_reversed=True, group_mask=4)
    high.stop(7)
    assert target.packets(8, 0) == [
        b"\x00\x03",
        struct.pack("<BBff?f", 7, 1, 1.5, 0.0, True, 2.0),
        struct.pack("<BBff?f", 8, 0, 0.25, 0.0, True, 3.0),
        struct.pack("<4B5f", 12, 2, 1, 0, 1.0, -2.0, 0.5, 0.75, 4.0),
        struct.pack("<4BIB", 6, 5, 1, 0, 264, 3),
        struct.pack("<6Bf", 13, 4, 1, 0, 1, 5, 1.5),
        b"\x03\x07",
    ]


@pytest.mark.parametrize(
    ("protocol", "go_to", "start"), [(7, 4, 5), (8, 12, 5), (9, 12, 5), (10, 12, 13)]
)
def test_high_level_commands_of_older_firmware(make_vehicle, make_link, protocol, go_to, start):
    target = make_vehicle(protocol=protocol)
    link = make_link(target.uri)
    link.connect()
    link.high_level.go_to((1.0, -2.0, 0.5), 0.75, 4.0)
    link.high_level.define_trajectory(5, range(132), 1)
    link.high_level.start_trajectory(5, 1.5)
    forms = {
        4: struct.pack("<3B5f", 4, 0, 0, 1.0, -2.0, 0.5, 0.75, 4.0),
        12: struct.pack("<4B5f", 12, 0, 0, 0, 1.0, -2.0, 0.5, 0.75, 4.0),
        5: struct.pack("<5Bf", 5, 0, 0, 0, 5, 1.5),
        13: struct.pack("<6Bf", 13, 0, 0, 0, 0, 5, 1.5),
    }
    assert [data for data in target.packets(8, 0) if data[0] != 6] == [forms[go_to], forms[start]]


def test_a_refused_command_says_why(target, flying):
    target.answers[8, 0, 7] = b"\x07\x00\x00\x0c"
    with pytest.raises(RefusedError, match=r"takeoff command.*Cannot allocate memory, 12"):
        flying.high_level.take_off(1.0, 2.0)
    # Without a code it is not a reply.
    target.answers[8, 0, 3] = b"\x03\x00\x00"
    flying.high_level.stop()


IMPOSSIBLE_COMMANDS = [
    lambda h: h.take_off(NAN, 1.0),
    lambda h: h.take_off(1.0, 0.0),
    lambda h: h.land(0.0, -1.0),
    lambda h: h.land(0.0, 1.0, 256),
    lambda h: h.go_to((0, 0, NAN), 0, 1),
    lambda h: h.start_trajectory(256),
    lambda h: h.start_trajectory(0, 0.0),
    lambda h: h.define_trajectory(0, range(0), 256),
    lambda h: h.take_off(1e39, 1.0),
    lambda h: h.land(0.0, 1e39),
    lambda h: h.land(0.0, 1e-50),
    lambda h: h.go_to((0, 0, 0), 1e39, 1),
]


def test_commands_that_make_no_sense_are_not_only_packet(target, flying):
    for send in IMPOSSIBLE_COMMANDS:
        with pytest.raises(ValueRangeError):
            send(flying.high_level)
    assert target.packets(8, 0) == []


def piece(seed):
    x, y, z, yaw = np.random.default_rng(seed).normal(size=(4, 8)).astype(np.float32).tolist()
    return PolynomialPiece(0.5 + seed, x, y, z, yaw)


def test_upload_writes_the_pieces_and_defines_the_trajectory(target, flying):
    pieces = [piece(k) for k in range(3)]
    flying.trajectories.upload(4, 2, pieces)
    memory = bytearray(4096)
    for data in target.packets(4, 2):
        number, address = struct.unpack_from("<BI", data)
        assert number == 1
        assert len(data) <= 29
        memory[address : address + len(data) - 5] = data[5:]
    expected = b"".join(struct.pack("<33f", *p.x, *p.y, *p.z, *p.yaw, p.duration) for p in pieces)
    assert bytes(memory) == bytes(264) + expected + bytes(4096 - 264 - len(expected))
    assert only_packet(target, 8, 0) == struct.pack("<4BIB", 6, 4, 1, 0, 264, 3)


def test_pieces_are_cflibs():
    one = piece(1)
    expected = Poly4D(one.duration, *(Poly4D.Poly(axis) for axis in one.axes)).pack()
    assert one.pack() == bytes(expected)


IMPOSSIBLE_TRAJECTORIES = [
    (0, []),
    (30, [piece(0), piece(1)]),
    (0, [PolynomialPiece(0.0, (), (), (), ())]),
    (0, [PolynomialPiece(1.0, (0.0,) * 9, (), (), ())]),
    (0, [PolynomialPiece(1.0, (NAN,), (), (), ())]),
    (0, [PolynomialPiece(1.0, (1e39,), (), (), ())]),
]


def test_trajectories_that_cannot_be_flown_are_not_only_packet(target, flying):
    for offset, pieces in IMPOSSIBLE_TRAJECTORIES:
        with pytest.raises(ValueRangeError):
            flying.trajectories.upload(0, offset, pieces)
    assert target.packets(4, 2) == []


def test_a_trajectory_whose_memory_is_overwritten_is_not_started(target, flying):
    upload, start = flying.trajectories.upload, flying.high_level.start_trajectory
    upload(1, 0, [piece(0), piece(1)])
    upload(2, 2, [piece(2)])
    start(1)
    flying.high_level.go_to((0.0, 0.0, 1.0), 0.0, 1.0)
    upload(3, 1, [piece(3)])
    with pytest.raises(RefusedError, match="upload of 3 has overwritten 1 .*upload 1 again"):
        start(1)
    start(2)
    flying.high_level.go_to((0.0, 0.0, 1.0), 0.0, 1.0)
    upload(1, 0, [piece(0)])
    start(1)

    def abort():
        raise RefusedError("no more")

    with pytest.raises(RefusedError, match="no more"):
        upload(2, 2, [piece(4)], abort)
    with pytest.raises(RefusedError, match="upload of 2 has overwritten 2"):
        start(2)


@pytest.fixture
def on_trajectory(target, flying):
    """Return a vehicle that flies the trajectory 1, of the second and third piece."""
    flying.high_level.stop()
    flying.trajectories.upload(1, 1, [piece(1), piece(2)])
    flying.high_level.take_off(1.0, 1.0)
    flying.high_level.start_trajectory(1)
    yield flying
    target.flight.restart()
    flying.high_level.set_group_mask(0)
    flying.high_level.stop()


def compressed(trajectories, offset):
    trajectories.upload_compressed(2, offset, (0, 0, 0, 0), [(1.0, [], [], [], [])])


@pytest.mark.parametrize(
    "upload",
    [
        lambda t: t.upload(1, 1, [piece(0)]),
        lambda t: t.upload(2, 0, [piece(0), piece(0)]),
        lambda t: t.upload(2, 2, [piece(0)]),
        lambda t: compressed(t, 3 * PIECE_SIZE - 1),
    ],
)
def test_the_memory_of_the_trajectory_that_is_flown_is_not_written(target, on_trajectory, upload):
    """The firmware evaluates it straight from there."""
    target.received.clear()
    with pytest.raises(RefusedError, match="bytes .* overlap 132 to 396, of the trajectory that"):
        upload(on_trajectory.trajectories)
    assert target.packets(4, 2) == []
    # What was not written can still be flown.
    on_trajectory.high_level.start_trajectory(1)


def test_memory_beside_the_trajectory_that_is_flown_is_written(target, on_trajectory):
    on_trajectory.trajectories.upload(2, 0, [piece(0)])
    on_trajectory.trajectories.upload(3, 3, [piece(0)])


@pytest.mark.parametrize(
    "command",
    [
        lambda h: h.go_to((0.0, 0.0, 1.0), 0.0, 1.0),
        lambda h: h.land(0.0, 2.0),
        lambda h: h.stop(),
        lambda h: h.spiral(1.0, (0.1, 0.1), 0.0, 1.0),
    ],
)
def test_another_command_frees_the_memory(target, on_trajectory, command):
    command(on_trajectory.high_level)
    on_trajectory.trajectories.upload(1, 1, [piece(0)])


def test_a_command_for_other_groups_frees_no_memory(target, on_trajectory):
    on_trajectory.high_level.set_group_mask(1)
    on_trajectory.high_level.go_to((0.0, 0.0, 1.0), 0.0, 1.0, group_mask=2)
    with pytest.raises(RefusedError, match="overlap"):
        on_trajectory.trajectories.upload(1, 1, [piece(0)])


def test_a_vehicle_whose_planner_has_ended_takes_an_upload(target, on_trajectory):
    # On the ground, or on setpoints.
    target.flight.pin(0x20E)
    on_trajectory.trajectories.upload(1, 1, [piece(0)])


def test_a_trajectory_that_is_refused_is_not_defined(target, flying):
    target.answers[4, 2, 1] = struct.pack("<BIB", 1, 0, 5)
    with pytest.raises(RefusedError, match="byte 0"):
        flying.trajectories.upload(0, 0, [piece(0)])
    assert target.packets(8, 0) == []
