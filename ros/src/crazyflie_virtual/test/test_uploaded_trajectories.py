"""Trajectories that are uploaded, also compressed ones."""

import errno
import math
import struct

import pytest
from cflib.crazyflie.high_level_commander import HighLevelCommander
from cflib.crazyflie.mem import CompressedSegment, CompressedStart, Poly4D
from hypothesis import given
from hypothesis import strategies as st
from virtual_bench import Bench, cflib_client, command

from crazyflie_virtual.crtp import Port
from crazyflie_virtual.firmware.planner import read_compressed

POINT = st.floats(-3.0, 3.0)
CURVE = st.sampled_from([0, 1, 3, 7]).flatmap(lambda n: st.lists(POINT, min_size=n, max_size=n))
SEGMENT = st.tuples(st.floats(0.1, 5.0), CURVE, CURVE, CURVE, CURVE)
START = st.tuples(POINT, POINT, POINT, POINT)


def packed(*elements):
    """Return what cflib writes into the memory."""
    return b"".join(bytes(element.pack()) for element in elements)


def de_casteljau(points, s):
    """Return the point of a Bezier curve, by repeated interpolation."""
    while len(points) > 1:
        points = [(1.0 - s) * a + s * b for a, b in zip(points, points[1:], strict=False)]
    return points[0]


@given(START, st.lists(SEGMENT, max_size=4), st.floats(0.0, 1.0))
def test_pieces_are_bezier_curves_that_begin_where_the_last_one_ended(start, segments, s):
    memory = packed(CompressedStart(*start), *(CompressedSegment(*each) for each in segments))
    pieces = read_compressed(memory + bytes(20))
    if not segments:
        assert [piece.duration for piece in pieces] == [0.0]
        return
    ends = list(start)
    for piece, (duration, *curves) in zip(pieces, segments, strict=True):
        assert piece.duration == pytest.approx(duration, abs=1e-3)
        goal = piece.evaluate(s * piece.duration)
        points = [[end, *curve] for end, curve in zip(ends, curves, strict=True)]
        # In millimetres, and in tenths of a degree.
        expected = [de_casteljau(each, s) for each in points]
        assert goal.position == pytest.approx(expected[:3], abs=1.1e-3)
        assert goal.yaw == pytest.approx(expected[3], abs=math.radians(0.11))
        ends = [each[-1] for each in points]


def test_the_example_of_the_documentation():
    # 2000 ms, cubic in x and y.
    body = struct.pack("<6h", 100, 200, 300, -1, -2, -3)
    (piece,) = read_compressed(bytes(8) + bytes.fromhex("0ad007") + body)
    assert piece.duration == 2.0
    assert piece.evaluate(2.0).position == pytest.approx((0.3, -0.003, 0.0))
    assert (piece.z, piece.yaw) == ((0.0,), (0.0,))


def test_what_was_in_the_memory_before_is_flown_too():
    one = CompressedSegment(1.0, [1.0], [], [], [])
    start = CompressedStart(0.0, 0.0, 0.0, 0.0)
    memory = bytearray(packed(start, one, one, one) + bytes(20))
    shorter = packed(start, CompressedSegment(1.0, [2.0], [], [], []))
    memory[: len(shorter)] = shorter
    assert len(read_compressed(memory)) == 3


@given(st.binary(max_size=300))
def test_any_memory_can_be_read(memory):
    if len(memory) < 8:
        with pytest.raises(ValueError, match="8 bytes"):
            read_compressed(memory)
        return
    pieces = read_compressed(memory)
    assert all(
        math.isfinite(p) for piece in pieces for p in piece.evaluate(piece.duration).position
    )


@pytest.fixture
def bench():
    return Bench()


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
        ((1, 9, 0, 1), "no trajectory has type 9 and location 1"),
        ((2, 0, 0, 1), "no trajectory has type 0 and location 2"),
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
    assert "HLC: the trajectory ends at once" in text


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


@pytest.mark.parametrize("moment", [1.0, 3.0])
def test_an_upload_over_the_trajectory_that_is_flown_changes_it(bench, moment):
    """The firmware does not copy it; at its end it holds the end of what is there."""
    bench.take_off()
    upload(bench, straight(0.2, 2.0))
    assert command(bench, "define_trajectory", 1, 0, 1) == 0
    assert command(bench, "start_trajectory", 1, relative_position=True) == 0
    bench.run(moment)
    share = min(moment, 2.0) / 2.0
    assert bench.firmware.setpoint.x == pytest.approx(0.2 * share, abs=0.02)
    upload(bench, straight(0.6, 2.0))
    bench.run(0.02)
    assert bench.firmware.setpoint.x == pytest.approx(0.6 * share, abs=0.03)
    # Another plan is not in this memory.
    assert command(bench, "go_to", 0.0, 0.0, 1.0, 0.0, 1.0) == 0
    upload(bench, straight(-1.0, 2.0))
    bench.run(1.5)
    assert bench.firmware.setpoint.x == pytest.approx(0.0, abs=0.01)
