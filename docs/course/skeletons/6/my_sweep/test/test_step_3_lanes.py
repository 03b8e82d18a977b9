"""Step 3: lanes, and arcs between them."""

import math

import pytest

from crazyflie_sweep.sweep_parameters import Area
from my_sweep.lanes import Arc, Line, lane_offsets, sweep

AREA = Area.from_mapping({"x_min": 0.0, "x_max": 3.0, "y_min": 0.0, "y_max": 3.0})


def test_lanes_are_in_the_middle_of_equal_strips():
    assert lane_offsets(2.0, 1.0) == pytest.approx([0.5, 1.5])


def test_lanes_are_never_wider_than_asked_for():
    assert lane_offsets(2.0, 0.9) == pytest.approx([1 / 3, 1.0, 5 / 3])


@pytest.mark.parametrize(
    ("turn", "middle", "direction"),
    [(math.pi, (3.5, 1.0, 1.0), (0.0, 1.0, 0.0)), (-math.pi, (2.5, 1.0, 1.0), (0.0, 1.0, 0.0))],
    ids=["left", "right"],
)
def test_an_arc_leads_around_its_centre(turn, middle, direction):
    arc = Arc((3.0, 1.0, 1.0), 0.5, -math.pi / 2.0, turn)
    for s, expected in ((0.0, (3.0, 0.5, 1.0)), (arc.length, (3.0, 1.5, 1.0))):
        assert arc.at(s)[0] == pytest.approx(expected)
    position, tangent = arc.at(arc.length / 2.0)
    assert position == pytest.approx(middle)
    assert tangent == pytest.approx(direction, abs=1e-9)


def test_a_sweep_is_lanes_with_arcs_between_them():
    path = sweep(AREA, 1.0, 1.2)
    assert [type(segment) for segment in path.segments] == [Line, Arc, Line, Arc, Line]
    assert path.length == pytest.approx(3 * 3.0 + 2 * math.pi * 0.5)
    assert [path.at(s)[0] for s in (0.0, path.length)] == [
        pytest.approx((0.0, 0.5, 1.2)),
        pytest.approx((3.0, 2.5, 1.2)),
    ]


def test_a_sweep_has_no_jump_and_no_corner():
    path = sweep(AREA, 1.0, 1.2)
    step = 0.01
    points = [path.at(k * step) for k in range(int(path.length / step))]
    for (p, u), (q, v) in zip(points, points[1:], strict=False):
        assert math.dist(p, q) < 1.001 * step
        assert math.dist(u, v) < 2.1 * step  # rad on an arc of 0.5 m


def test_arcs_are_outside_of_the_area():
    path = sweep(AREA, 1.0, 1.2)
    xs = [path.at(0.01 * k)[0][0] for k in range(int(path.length / 0.01))]
    assert (min(xs), max(xs)) == pytest.approx((-0.5, 3.5), abs=0.001)
