"""Step 3: the path, and the point that moves along it."""

import pytest

from my_sweep.lanes import Area, Walker, corners

AREA = Area(0.0, 3.0, 0.0, 2.0)


def test_lanes_lead_there_and_back():
    assert corners(AREA, 1.0) == [(0.0, 0.5), (3.0, 0.5), (3.0, 1.5), (0.0, 1.5)]


def test_lanes_are_never_wider():
    assert [y for _, y in corners(AREA, 0.9)[::2]] == pytest.approx([1 / 3, 1.0, 5 / 3])


@pytest.mark.parametrize(("x", "expected"), [(0.0, 2.0), (1.5, 5.5), (3.0, 9.0), (4.0, 9.0)])
def test_the_lane_is_as_long_as_the_oscillator(x, expected):
    assert AREA.service_position(x) == pytest.approx(expected)


def test_the_point_goes_around_corners():
    walker = Walker((0.0, 0.0), [(1.0, 0.0), (1.0, 1.0)])
    walker.advance(0.5)
    assert walker.position == pytest.approx((0.5, 0.0))
    walker.advance(0.75)
    assert walker.position == pytest.approx((1.0, 0.25))
    assert not walker.is_done
    walker.advance(5.0)
    assert walker.position == pytest.approx((1.0, 1.0))
    assert walker.is_done
