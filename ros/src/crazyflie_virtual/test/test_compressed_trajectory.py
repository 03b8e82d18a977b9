"""Compressed trajectories, against the definition of a Bezier curve."""

import math
import struct

import pytest
from cflib.crazyflie.mem import CompressedSegment, CompressedStart
from hypothesis import given
from hypothesis import strategies as st

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
