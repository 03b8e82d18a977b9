"""High-level commands: what cflib sends, what is answered, what is flown."""

import errno
import math
import struct

import pytest
from cflib.crazyflie.high_level_commander import HighLevelCommander
from cflib.crazyflie.mem import CompressedSegment, CompressedStart, Poly4D
from virtual_bench import Bench, cflib_client

from crazyflie_model.supervisor import SupervisorState
from crazyflie_virtual.firmware.planner import REFUSED
from crazyflie_virtual.link.crtp import Port


@pytest.fixture
def bench():
    return Bench()


def command(bench, method, *arguments, protocol=12, **keywords):
    """Send what cflib's high-level commander sends; return the error number."""
    client, sent = cflib_client(protocol)
    getattr(client.high_level_commander, method)(*arguments, **keywords)
    (packet,) = sent
    answer = bench.ask_one(packet.port, packet.channel, packet.data)
    assert len(answer) == 4
    assert answer[:2] == packet.data[:2]
    return answer[3]


def upload(bench, *pieces, address=0):
    data = b"".join(bytes(piece.pack()) for piece in pieces)
    for start in range(0, len(data), 24):
        chunk = data[start : start + 24]
        request = struct.pack("<BI", 1, address + start) + chunk
        assert bench.ask_one(Port.MEMORY, 2, request)[-1] == 0


def straight(x, duration):
    """Return a piece that goes x metres along x at height 1."""
    zero = [0.0] * 8
    along = [0.0, x / duration] + [0.0] * 6
    up = [1.0] + [0.0] * 7
    return Poly4D(duration, *(Poly4D.Poly(c) for c in (along, zero, up, zero)))


def test_takeoff_follows_the_polynomial(bench):
    assert command(bench, "takeoff", 1.0, 2.0) == 0
    for k in range(1, 21):
        bench.run(0.1)
        s = k / 20
        expected = 35 * s**4 - 84 * s**5 + 70 * s**6 - 20 * s**7
        assert bench.firmware.setpoint.z == pytest.approx(expected, abs=0.01)
    bench.run(4.0)
    assert bench.height == pytest.approx(1.0, abs=0.1)


def test_takeoff_turns_to_its_yaw_or_keeps_it():
    bench = Bench(init_yaw=0.5)
    command(bench, "takeoff", 0.5, 1.0, yaw=None)
    bench.run(3.0)
    assert bench.firmware.estimate.yaw == pytest.approx(math.degrees(0.5), abs=2.0)
    command(bench, "land", 0.0, 1.0, yaw=1.0)
    bench.run(0.98)
    assert bench.firmware.setpoint.yaw == pytest.approx(math.degrees(1.0), abs=1.0)


def test_land_stops_the_motors_on_the_ground(bench):
    bench.take_off()
    assert command(bench, "land", 0.0, 2.0) == 0
    assert command(bench, "land", 0.0, 2.0) == REFUSED
    bench.run(2.5)
    assert bench.height == 0.0
    assert not bench.motors_run
    bench.take_off()


def test_go_to(bench):
    bench.take_off()
    assert command(bench, "takeoff", 2.0, 2.0) == REFUSED
    assert command(bench, "go_to", 1.0, -0.5, 1.5, math.pi / 2, 3.0) == 0
    bench.run(6.0)
    x, y, z = bench.physics.position
    assert (x, y, z) == pytest.approx((1.0, -0.5, 1.5), abs=0.06)
    assert bench.firmware.estimate.yaw == pytest.approx(90.0, abs=2.0)
    assert command(bench, "go_to", 0.0, 0.5, 0.0, 0.0, 2.0, relative=True, linear=True) == 0
    bench.run(5.0)
    assert bench.physics.position[1] == pytest.approx(0.0, abs=0.06)


def test_flight_by_mellingers_controller(bench):
    for number, taken in ((7, 1), (2, 2)):
        name_and_type = b"\0stabilizer\0controller\0\x08"
        bench.ask_one(Port.PARAMETERS, 3, name_and_type + bytes([number]))
        assert bench.firmware.stabilizer.controller == taken
    bench.take_off()
    command(bench, "go_to", 1.0, -0.5, 1.5, math.pi / 2, 3.0)
    lag = 0.0
    for _ in range(30):
        bench.run(0.1)
        lag = max(lag, abs(bench.firmware.setpoint.x - bench.firmware.estimate.x))
    # With the PID controller it lags by 0.36 m.
    assert lag < 0.1
    bench.run(3.0)
    assert bench.physics.position == pytest.approx((1.0, -0.5, 1.5), abs=0.06)
    assert bench.firmware.estimate.yaw == pytest.approx(90.0, abs=2.0)
    command(bench, "land", 0.0, 2.0)
    bench.run(2.5)
    assert bench.height == 0.0
    assert not bench.motors_run


@pytest.mark.parametrize("protocol", [7, 12])
def test_trajectory_from_memory(bench, protocol):
    bench.take_off()
    upload(bench, straight(1.0, 2.0), straight(0.0, 1.0), address=132)
    client, sent = cflib_client()
    client.high_level_commander.define_trajectory(3, 132, 1)
    bench.ask(*sent[0])
    assert command(bench, "start_trajectory", 3, 1.5, protocol=protocol) == 0
    bench.run(1.5)
    assert bench.firmware.setpoint.x == pytest.approx(0.5, abs=0.02)
    bench.run(4.0)
    assert bench.physics.position[0] == pytest.approx(1.0, abs=0.06)
    # Backwards, from where the vehicle is.
    keywords = {"relative_position": True, "reversed": True}
    assert command(bench, "start_trajectory", 3, 1.0, protocol=protocol, **keywords) == 0
    bench.run(4.5)
    assert bench.physics.position[0] == pytest.approx(0.0, abs=0.06)


@pytest.mark.parametrize(
    ("define", "reason"),
    [
        (None, "it is not defined"),
        ((1, 0, 4000, 1), "1 pieces at byte 4000 are not in the memory"),
        ((1, 0, 0, 0), "0 pieces at byte 0 are not in the memory"),
        ((1, 0, 0, 32), "32 pieces at byte 0 are not in the memory"),
        ((1, 1, 4090, 1), "a compressed trajectory begins with 8 bytes"),
        ((1, 9, 0, 1), "there are none of type 9 at location 1"),
        ((2, 0, 0, 1), "there are none of type 0 at location 2"),
        ((1, 0, 132, 1), "numbers that are not finite, or a negative duration"),
    ],
)
def test_trajectories_that_cannot_be_flown_are_told_on_the_console(bench, define, reason):
    bench.take_off()
    upload(bench, straight(1.0, 1.0), straight(1.0, -1.0))
    if define is not None:
        packet = struct.pack("<4BIB", 6, 5, *define)
        assert bench.ask_one(Port.HIGH_LEVEL, 0, packet)[3] == 0
    assert command(bench, "start_trajectory", 5) == 0
    before = bench.firmware.setpoint
    bench.run(1.0)
    assert bench.firmware.setpoint.x == before.x
    assert bench.height == pytest.approx(1.0, abs=0.1)
    text = b"".join(p.data for p in bench.unsolicited if p.port == Port.CONSOLE).decode()
    assert "HLC: no trajectory 5: " in text
    assert reason in text


@pytest.mark.parametrize("scale", [0.0, -1.0, math.nan])
def test_with_no_positive_time_scale_a_trajectory_is_at_its_end_at_once(bench, scale):
    bench.take_off()
    upload(bench, straight(0.2, 1.0))
    assert command(bench, "define_trajectory", 1, 0, 1) == 0
    assert command(bench, "start_trajectory", 1, scale) == 0
    bench.run(0.02)
    setpoint = bench.firmware.setpoint
    assert (setpoint.x, setpoint.y, setpoint.z) == pytest.approx((0.2, 0.0, 1.0))
    assert setpoint.vx == 0.0
    assert command(bench, "start_trajectory", 1, scale, relative_position=True) == 0
    bench.run(0.02)
    assert bench.firmware.setpoint.x == pytest.approx(0.2)
    text = b"".join(p.data for p in bench.unsolicited if p.port == Port.CONSOLE).decode()
    assert "HLC: at its end at once" in text


def test_memory_that_was_never_written_is_at_the_origin(bench):
    bench.take_off()
    assert command(bench, "go_to", 1.0, 0.0, 1.0, 0.0, 2.0) == 0
    bench.run(4.0)
    define = struct.pack("<4BIB", 6, 1, 1, 0, 0, 1)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, define)[3] == 0
    assert command(bench, "start_trajectory", 1) == 0
    bench.run(0.1)
    setpoint = bench.firmware.setpoint
    assert (setpoint.x, setpoint.y, setpoint.z) == (0.0, 0.0, 0.0)


A, B, C = 0.9, 0.5, 0.5
FIGURE_EIGHT = [
    CompressedStart(0.0, 0.0, 0.0, 0.0),
    CompressedSegment(2.0, [0.0, 1.0, 1.0], [0.0, A, 0.0], [], []),
    CompressedSegment(2.0, [1.0, B, 0.0], [-A, -C, 0.0], [], []),
    CompressedSegment(2.0, [-B, -1.0, -1.0], [C, A, 0.0], [], []),
    CompressedSegment(2.0, [-1.0, 0.0, 0.0], [-A, 0.0, 0.0], [], []),
]
"""The trajectory of cflib's example autonomous_sequence_high_level_compressed."""


def define_compressed(bench, trajectory):
    """Upload and define a trajectory, as cflib's example does."""
    upload(bench, *trajectory)
    kind = HighLevelCommander.TRAJECTORY_TYPE_POLY4D_COMPRESSED
    assert command(bench, "define_trajectory", 1, 0, len(trajectory), type=kind) == 0


def test_the_compressed_trajectory_of_cflibs_example(bench):
    bench.take_off()
    define_compressed(bench, FIGURE_EIGHT)
    begin = bench.firmware.setpoint
    assert command(bench, "start_trajectory", 1, 1.0, relative_position=True) == 0
    for x in (1.0, 0.0, -1.0, 0.0, 0.0):
        bench.run(2.0)
        setpoint = bench.firmware.setpoint
        assert (setpoint.x, setpoint.y) == pytest.approx((begin.x + x, begin.y), abs=0.02)
        assert setpoint.z == begin.z
        assert math.dist(bench.physics.position[:2], (setpoint.x, setpoint.y)) < 0.6
    bench.run(2.0)
    assert bench.physics.position == pytest.approx((0.0, 0.0, 1.0), abs=0.06)


@pytest.mark.parametrize("keywords", [{"reversed": True}, {"time_scale": 2.0}])
def test_compressed_trajectories_are_neither_flown_backwards_nor_scaled(bench, keywords):
    bench.take_off()
    define_compressed(bench, FIGURE_EIGHT)
    assert command(bench, "start_trajectory", 1, **keywords) == errno.ENOEXEC
    bench.run(2.0)
    assert bench.physics.position == pytest.approx((0.0, 0.0, 1.0), abs=0.06)


def test_a_spiral_ends_where_it_has_to(bench):
    bench.take_off()
    begin = bench.firmware.setpoint
    assert command(bench, "spiral", -math.pi / 2, 0.4, 0.6, -0.3, 3.0, clockwise=True) == 0
    bench.run(7.0)
    # Backwards about an axis 0.4 m to the right.
    expected = (begin.x - 0.6, begin.y - 0.4, begin.z - 0.3)
    assert bench.physics.position == pytest.approx(expected, abs=0.06)
    assert bench.firmware.estimate.yaw == pytest.approx(90.0, abs=4.0)


@pytest.mark.parametrize("angle", [math.nan, math.inf])
def test_a_spiral_that_is_not_a_number_levels_out(bench, angle):
    bench.take_off()
    error = command(bench, "spiral", angle, 0.4, math.nan, 0.0, 2.0)
    assert error == 0
    bench.run(0.1)
    assert SupervisorState.HIGH_LEVEL_DISABLED in bench.firmware.info
    assert command(bench, "takeoff", 1.0, 2.0) == REFUSED


def test_stop_drops_the_vehicle(bench):
    bench.take_off()
    assert command(bench, "stop") == 0
    bench.run(1.0)
    assert bench.height == 0.0


def test_groups(bench):
    assert command(bench, "set_group_mask", 0b10) == 0
    assert command(bench, "takeoff", 1.0, 1.0, group_mask=0b01) == 0
    bench.run(1.0)
    assert bench.height == 0.0
    assert command(bench, "takeoff", 1.0, 1.0, group_mask=0b11) == 0
    bench.run(1.0)
    assert bench.height > 0.3


def test_the_groups_are_a_parameter(bench):
    name = b"hlCommander\0groupmask\0"
    assert bench.ask_one(Port.PARAMETERS, 3, b"\0" + name + b"\x08\x02")[-1] == 0
    assert bench.firmware.planner.groups == 0b10
    assert command(bench, "takeoff", 1.0, 1.0, group_mask=0b01) == 0
    bench.run(1.0)
    assert bench.height == 0.0
    assert command(bench, "takeoff", 1.0, 1.0, group_mask=0b10) == 0
    bench.run(1.0)
    assert bench.height > 0.3


@pytest.mark.parametrize("number", [1, 9])
def test_other_takeoffs(bench, number):
    forms = {1: ("<BBff", 0.5, 1.0), 9: ("<BBf?f?f", 0.5, True, 0.0, False, 0.5)}
    form, *values = forms[number]
    data = struct.pack(form, number, 0, *values)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, data)[3] == 0
    bench.run(4.0)
    assert bench.height == pytest.approx(0.5, abs=0.1)
    forms = {1: ("<BBff", 2, 0, 0.0, 1.0), 9: ("<BBf?f?f", 10, 0, 0.5, True, 0.0, False, 0.5)}
    form, *values = forms[number]
    assert bench.ask_one(Port.HIGH_LEVEL, 0, struct.pack(form, *values))[3] == 0
    bench.run(2.0)
    assert bench.height == 0.0


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (b"\x63", errno.ENOEXEC),
        (b"\x07\x00", errno.EINVAL),
    ],
)
def test_what_is_no_command(bench, data, error):
    assert bench.ask_one(Port.HIGH_LEVEL, 0, data)[3] == error
    bench.run(0.5)
    assert bench.height == 0.0
