"""Compressed trajectories, byte by byte, and what does not fit in their 16 bits."""

import math
import struct

import pytest
from wire_helpers import only_packet

from crazyflie_link.errors import RefusedError, ValueRangeError

NAN = float("nan")
START = (1.0, -0.5, 0.25, math.pi / 2.0)
#: A straight line, a constant, and curves of degree 3 and 7.
SEGMENT = (1.5, (0.5,), (), (0.1, 0.2, -0.3), (0.0,) * 6 + (-math.pi,))


def written(target):
    """Return what was written to the memory of trajectories: its first address, and bytes."""
    chunks = [(struct.unpack_from("<BI", data), data[5:]) for data in target.packets(4, 2)]
    assert {number for (number, _), _ in chunks} == {1}
    return chunks[0][0][1], b"".join(data for _, data in chunks)


def test_it_is_in_millimetres_milliseconds_and_tenths_of_degrees(target, flying):
    flying.trajectories.upload_compressed(3, 40, START, [SEGMENT, (0.25, (), (), (), ())])
    # Two bits for each axis say how many points it has: 1, none, 3, 7.
    expected = struct.pack("<4h", 1000, -500, 250, 900)
    expected += struct.pack("<BH", 0b11_10_00_01, 1500) + struct.pack("<h", 500)
    expected += struct.pack("<3h", 100, 200, -300) + struct.pack("<7h", *[0] * 6, -1800)
    # A segment in which nothing moves, and one without a duration: the end.
    expected += struct.pack("<BH", 0, 250) + struct.pack("<BH", 0, 0)
    assert written(target) == (40, expected)
    assert only_packet(target, 8, 0) == struct.pack("<4BIB", 6, 3, 1, 1, 40, 2)


def test_the_memory_may_be_filled_to_its_last_byte(target, flying):
    upload, segment = flying.trajectories.upload_compressed, (1.0, (), (), (), ())
    # 8 bytes of the start, 3 of the segment and 3 of the end, of 4096.
    upload(3, 4082, START, [segment])
    with pytest.raises(ValueRangeError, match="14 bytes from byte 4083 on do not fit"):
        upload(3, 4083, START, [segment])
    target.received.clear()
    # The number of segments has one byte, which the firmware does not need.
    upload(3, 0, START, [segment] * 300)
    assert only_packet(target, 8, 0)[-1] == 255


def test_an_upload_that_overlaps_keeps_the_other_from_flying(target, flying):
    flying.trajectories.upload_compressed(1, 0, START, [(1.0, (), (), (), ())])
    flying.trajectories.upload_compressed(2, 14, START, [(1.0, (), (), (), ())])
    flying.high_level.start_trajectory(1)
    flying.high_level.go_to((0.0, 0.0, 1.0), 0.0, 1.0)
    flying.high_level.begin_upload(3, range(13, 14))
    with pytest.raises(RefusedError, match="upload of 3 has overwritten 1"):
        flying.high_level.start_trajectory(1)
    flying.high_level.start_trajectory(2)


def test_the_largest_and_the_smallest_numbers_are_sent(target, flying):
    most, turn = 32.767, math.radians(3276.7)
    for sign in (1.0, -1.0):
        points = (sign * most,)
        start = (*points * 3, sign * turn)
        for duration in (0.001, 65.535):
            segment = (duration, points, points, points, (sign * turn,))
            flying.trajectories.upload_compressed(3, 0, start, [segment])


BAD = [
    ("duration is 0.00099 s; expected 0.001 to", START, (0.00099, (), (), (), ())),
    ("duration is 65.536 s", START, (65.536, (), (), (), ())),
    ("duration is nan s", START, (NAN, (), (), (), ())),
    ("x has 2 control points", START, (1.0, (0.0, 0.0), (), (), ())),
    ("segment 0: y is 32.768 m; expected at most", START, (1.0, (), (32.768,), (), ())),
    ("segment 0: z is -40 m", START, (1.0, (), (), (0.0, -40.0, 0.0), ())),
    ("segment 0: x is nan m", START, (1.0, (NAN,), (), (), ())),
    ("segment 0: yaw is 57.3 rad", START, (1.0, (), (), (), (57.3,))),
    ("start: y is -33 m", (0.0, -33.0, 0.0, 0.0), SEGMENT),
    ("start: yaw is -57.3 rad", (0.0, 0.0, 0.0, -57.3), SEGMENT),
]


@pytest.mark.parametrize(("text", "start", "segment"), BAD)
def test_what_does_not_fit_is_not_sent(target, flying, text, start, segment):
    with pytest.raises(ValueRangeError, match=text):
        flying.trajectories.upload_compressed(3, 0, start, [segment])
    assert target.packets(4, 2) == []


def test_without_segments_it_is_none(target, flying):
    with pytest.raises(ValueRangeError, match="has no segments"):
        flying.trajectories.upload_compressed(3, 0, START, [])
