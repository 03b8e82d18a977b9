"""Every packet that goes to the vehicle, byte by byte."""

import struct
import threading

import numpy as np
import pytest
from cflib.crazyflie.mem import Poly4D

from crazyflie_link.errors import RefusedError, UnknownNameError, ValueRangeError
from crazyflie_model.polynomials import PolynomialPiece

NAN = float("nan")


@pytest.fixture
def vehicle(shared):
    """Return the module's vehicle as if it were new."""
    vehicle, _, parameters = shared
    vehicle.parameters.update(parameters)
    vehicle.answers.clear()
    vehicle.flight.restart()
    vehicle.received.clear()
    return vehicle


@pytest.fixture
def flying(shared):
    """Return the link to the module's vehicle."""
    return shared[1]


def sent(vehicle, port, channel):
    """Return the data of the only packet on a port and channel, once it is there."""
    (data,) = vehicle.wait_for_packets(port, channel)
    return data


def test_attitude_setpoint_has_its_pitch_negated(vehicle, flying):
    flying.setpoints.attitude(1.5, 10.0, -20.0, 42000)
    assert sent(vehicle, 3, 0) == struct.pack("<fffH", 1.5, -10.0, -20.0, 42000)


@pytest.mark.parametrize("protocol", [8, 12])
def test_generic_setpoints_are_those_of_crazyflie_cpp(make_vehicle, make_link, protocol):
    vehicle = make_vehicle(protocol=protocol)
    link = make_link(vehicle.uri)
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
        assert vehicle.wait_for_packets(7, 0, count)[-1] == data


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


def test_full_state_setpoint_is_in_thousandths_and_its_rates_in_milliradians(vehicle, flying):
    quaternion = np.array([0.1, -0.2, 0.3, 0.9])
    flying.setpoints.full_state(
        (1.25, -2.5, 0.5), (0.5, 0.25, -0.125), (0.0, 0.0, 9.75), quaternion, (0.5, -1.0, 2.0)
    )
    kind, *numbers = struct.unpack("<B9hI3h", sent(vehicle, 7, 0))
    assert kind == 6
    assert numbers[:9] == [1250, -2500, 500, 500, 250, -125, 0, 0, 9750]
    assert numbers[10:] == [500, -1000, 2000]
    np.testing.assert_allclose(
        decompressed(numbers[9]), quaternion / np.linalg.norm(quaternion), atol=2e-3
    )


def test_notify_setpoints_stop_takes_the_place_of_the_setpoint_that_waits(vehicle, flying):
    entered, free = threading.Event(), threading.Event()

    def block():
        entered.set()
        free.wait(30.0)

    flying.link().put(block)
    assert entered.wait(30.0)
    flying.setpoints.position(0.0, 0.0, 1.0, 0.0)
    flying.setpoints.notify_setpoints_stop(1500)
    free.set()
    assert sent(vehicle, 7, 1) == struct.pack("<BI", 0, 1500)
    # A setpoint that waited would be sent next.
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 2)
    assert vehicle.packets(7, 0) == []


def test_a_hundred_zeros(vehicle, flying):
    flying.setpoints.send_zero_thrust()
    assert vehicle.wait_for_packets(3, 0, 100) == [struct.pack("<fffH", 0, 0, 0, 0)] * 100


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


def test_numbers_that_cannot_be_flown_are_not_sent(vehicle, flying):
    for send in IMPOSSIBLE_SETPOINTS:
        with pytest.raises(ValueRangeError):
            send(flying.setpoints)
    flying.setpoints.position(0, 0, 1, 0)
    assert len(vehicle.wait_for_packets(7, 0)) == 1
    assert vehicle.packets(3, 0) == []


def test_high_level_commands(vehicle, flying):
    high = flying.high_level
    high.set_group_mask(3)
    high.take_off(1.5, 2.0, group_mask=1)
    high.land(0.25, 3.0)
    high.go_to((1.0, -2.0, 0.5), 0.75, 4.0, relative=True, group_mask=2)
    high.define_trajectory(5, 264, 3)
    high.start_trajectory(5, 1.5, relative=True, is_reversed=True, group_mask=4)
    high.stop(7)
    assert vehicle.packets(8, 0) == [
        b"\x00\x03",
        struct.pack("<BBff?f", 7, 1, 1.5, 0.0, True, 2.0),
        struct.pack("<BBff?f", 8, 0, 0.25, 0.0, True, 3.0),
        struct.pack("<4B5f", 12, 2, 1, 0, 1.0, -2.0, 0.5, 0.75, 4.0),
        struct.pack("<4BIB", 6, 5, 1, 0, 264, 3),
        struct.pack("<6Bf", 13, 4, 1, 0, 1, 5, 1.5),
        b"\x03\x07",
    ]


def test_high_level_commands_of_older_firmware(make_vehicle, make_link):
    vehicle = make_vehicle(protocol=7)
    link = make_link(vehicle.uri)
    link.connect()
    link.high_level.go_to((1.0, -2.0, 0.5), 0.75, 4.0)
    link.high_level.define_trajectory(5, 0, 1)
    link.high_level.start_trajectory(5, 1.5)
    assert [data for data in vehicle.packets(8, 0) if data[0] != 6] == [
        struct.pack("<3B5f", 4, 0, 0, 1.0, -2.0, 0.5, 0.75, 4.0),
        struct.pack("<5Bf", 5, 0, 0, 0, 5, 1.5),
    ]


def test_a_refused_command_says_why(vehicle, flying):
    vehicle.answers[8, 0, 7] = b"\x07\x00\x00\x0c"
    with pytest.raises(RefusedError, match=r"takeoff command.*Cannot allocate memory, 12"):
        flying.high_level.take_off(1.0, 2.0)


IMPOSSIBLE_COMMANDS = [
    lambda h: h.take_off(NAN, 1.0),
    lambda h: h.take_off(1.0, 0.0),
    lambda h: h.land(0.0, -1.0),
    lambda h: h.land(0.0, 1.0, 256),
    lambda h: h.go_to((0, 0, NAN), 0, 1),
    lambda h: h.start_trajectory(256),
    lambda h: h.start_trajectory(0, 0.0),
    lambda h: h.define_trajectory(0, 0, 256),
    lambda h: h.take_off(1e39, 1.0),
    lambda h: h.land(0.0, 1e39),
    lambda h: h.land(0.0, 1e-50),
    lambda h: h.go_to((0, 0, 0), 1e39, 1),
]


def test_commands_that_make_no_sense_are_not_sent(vehicle, flying):
    for send in IMPOSSIBLE_COMMANDS:
        with pytest.raises(ValueRangeError):
            send(flying.high_level)
    assert vehicle.packets(8, 0) == []


def piece(seed):
    x, y, z, yaw = np.random.default_rng(seed).normal(size=(4, 8)).astype(np.float32).tolist()
    return PolynomialPiece(0.5 + seed, x, y, z, yaw)


def test_upload_writes_the_pieces_and_defines_the_trajectory(vehicle, flying):
    pieces = [piece(k) for k in range(3)]
    flying.trajectories.upload(4, 2, pieces)
    memory = bytearray(4096)
    for data in vehicle.packets(4, 2):
        number, address = struct.unpack_from("<BI", data)
        assert number == 1
        assert len(data) <= 29
        memory[address : address + len(data) - 5] = data[5:]
    expected = b"".join(struct.pack("<33f", *p.x, *p.y, *p.z, *p.yaw, p.duration) for p in pieces)
    assert bytes(memory) == bytes(264) + expected + bytes(4096 - 264 - len(expected))
    assert sent(vehicle, 8, 0) == struct.pack("<4BIB", 6, 4, 1, 0, 264, 3)


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


def test_trajectories_that_cannot_be_flown_are_not_sent(vehicle, flying):
    for offset, pieces in IMPOSSIBLE_TRAJECTORIES:
        with pytest.raises(ValueRangeError):
            flying.trajectories.upload(0, offset, pieces)
    assert vehicle.packets(4, 2) == []


def test_a_trajectory_that_is_refused_is_not_defined(vehicle, flying):
    vehicle.answers[4, 2, 1] = struct.pack("<BIB", 1, 0, 5)
    with pytest.raises(RefusedError, match="byte 0"):
        flying.trajectories.upload(0, 0, [piece(0)])
    assert vehicle.packets(8, 0) == []


def test_external_pose(vehicle, flying):
    flying.localization.position(1.0, 2.0, 3.0)
    assert sent(vehicle, 6, 0) == struct.pack("<fff", 1, 2, 3)
    flying.localization.pose((1.0, 2.0, 3.0), (0.0, 0.0, 3.0, 4.0))
    kind, *numbers = struct.unpack("<B7f", sent(vehicle, 6, 1))
    assert kind == 8
    assert numbers == pytest.approx([1, 2, 3, 0, 0, 0.6, 0.8])
    for quaternion in ((0, 0, 0, 0), (0, 0, NAN, 1)):
        with pytest.raises(ValueRangeError):
            flying.localization.pose((0, 0, 0), quaternion)
    for x in (NAN, 1e39):
        with pytest.raises(ValueRangeError):
            flying.localization.position(x, 0, 0)


def test_arming_and_the_supervisor(vehicle, flying):
    flying.supervisor.arm()
    flying.supervisor.arm(False)
    flying.supervisor.recover()
    assert vehicle.packets(9, 1) == [b"\x01\x01", b"\x01\x00", b"\x02"]
    vehicle.answers[9, 0, 0x0C] = b"\x8c\x12\x00"
    assert flying.supervisor.read().words() == "armed, flying"
    vehicle.answers[9, 1, 1] = b"\x81\x00\x00"
    with pytest.raises(RefusedError, match="arming: .* its state is: armed, flying"):
        flying.supervisor.arm()


@pytest.mark.filterwarnings("ignore:The supervisor subsystem:UserWarning")
def test_arming_before_protocol_12(make_vehicle, make_link):
    vehicle = make_vehicle(protocol=10)
    link = make_link(vehicle.uri)
    link.connect()
    assert link.supervisor.read() is None
    link.supervisor.arm()
    assert sent(vehicle, 13, 0) == b"\x01\x01"
    link.supervisor.emergency_stop()
    assert set(vehicle.wait_for_packets(6, 1, 5)) == {b"\x03"}


def test_parameters_are_written_in_their_type(vehicle, flying):
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
    assert vehicle.packets(2, 2) == [
        b"\x00\x00\x07",
        b"\x01\x00" + struct.pack("<f", 2.0),
        b"\x04\x00" + struct.pack("<b", -100),
    ]
    assert parameters.values()["motor.trim"] == -100
    vehicle.parameters["sound.freq"] = ("H", 5000, 0)
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


def test_parameters_that_cannot_be_written(vehicle, flying):
    for name, value, error in IMPOSSIBLE_PARAMETERS:
        with pytest.raises(error, match=name):
            flying.parameters.write(name, value)
    assert vehicle.packets(2, 2) == []


def test_own_packets(vehicle, flying):
    flying.send_packet(13, 2, b"hello")
    assert sent(vehicle, 13, 2) == b"hello"
    flying.send_packet(13, 3, bytes(30))
    assert sent(vehicle, 13, 3) == bytes(30)
    for arguments in ((16, 0, b""), (0, 4, b""), (0, 0, bytes(31))):
        with pytest.raises(ValueRangeError):
            flying.send_packet(*arguments)
