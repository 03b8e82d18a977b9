"""The path through an area: where it leads, that it is smooth, and that it covers everything."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_sweep.lanes import Arc, LanePath, Line, lane_offsets, sweep
from crazyflie_sweep.sweep_parameters import Area
from crazyflie_sweep.sweeper import Coverage

AREA = Area(x_min=-1.5, x_max=1.5, y_min=-1.0, y_max=1.0)
WIDTH = st.floats(0.2, 5.0)


@given(WIDTH, WIDTH)
def test_lanes_are_no_further_apart_than_asked_for_and_no_more_than_needed(width, lane_width):
    offsets = lane_offsets(width, lane_width)
    edges = [-offsets[0], *offsets, 2.0 * width - offsets[-1]]
    spacings = [b - a for a, b in itertools.pairwise(edges)]
    assert spacings == pytest.approx([width / len(offsets)] * len(spacings))
    assert max(spacings) <= lane_width + 1e-6
    assert (len(offsets) - 1) * lane_width < width


def test_a_width_that_is_a_multiple_makes_no_lane_too_many():
    assert lane_offsets(3.0, 0.1) == pytest.approx([0.05 + 0.1 * k for k in range(30)])


def test_lanes_go_there_and_back():
    lanes = [s for s in sweep(AREA, 0.5, 0.8).segments if isinstance(s, Line)]
    ends = [(lane.begin, lane.end) for lane in lanes]
    assert ends == [
        ((-1.5, -0.75, 0.8), (1.5, -0.75, 0.8)),
        ((1.5, -0.25, 0.8), (-1.5, -0.25, 0.8)),
        ((-1.5, 0.25, 0.8), (1.5, 0.25, 0.8)),
        ((1.5, 0.75, 0.8), (-1.5, 0.75, 0.8)),
    ]


def test_length_is_that_of_lanes_and_half_circles():
    assert sweep(AREA, 0.5, 0.8).length == pytest.approx(4 * 3.0 + 3 * math.pi * 0.25)


@given(WIDTH, WIDTH, st.floats(0.2, 2.0), st.booleans())
def test_the_path_is_smooth_and_directions_are_its_derivatives(length, width, lane_width, reverse):
    path = sweep(Area(x_min=0.0, x_max=length, y_min=0.0, y_max=width), lane_width, 1.0)
    path = path.reversed() if reverse else path
    step = 1e-4
    for k in range(200):
        s = (path.length - step) * k / 199
        (a, direction), (b, _) = path.at(s), path.at(s + step)
        for d, p, q in zip(direction, a, b, strict=True):
            assert (q - p) / step == pytest.approx(d, abs=step / lane_width * 4 + 2e-3)


def test_arcs_reach_half_a_lane_beyond_the_area():
    path = sweep(AREA, 0.5, 1.0)
    xs = [path.at(path.length * k / 5000)[0][0] for k in range(5001)]
    assert max(xs) == pytest.approx(1.75, abs=1e-4)
    assert min(xs) == pytest.approx(-1.75, abs=1e-4)


def test_a_reversed_path_ends_where_the_path_begins():
    path = sweep(AREA, 0.5, 1.0)
    for s in (0.0, 1.0, 3.2, path.length):
        position, direction = path.at(s)
        again, opposite = path.reversed().at(path.length - s)
        assert again == pytest.approx(position)
        assert opposite == pytest.approx([-d for d in direction])


def test_beyond_its_end_a_path_ends():
    path = LanePath(
        [Line((0.0, 0.0, 1.0), (2.0, 0.0, 1.0)), Arc((2.0, 1.0, 1.0), 1.0, -math.pi / 2, 1.0)]
    )
    assert path.at(100.0)[0] == pytest.approx((2.0 + math.sin(1.0), 1.0 - math.cos(1.0), 1.0))
    assert path.segment_at(100.0) is path.segments[1]
    assert path.at(-1.0)[0] == (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("point", "distance"),
    [
        ((1.0, 0.3, 1.0), 0.3),
        ((1.0, 0.0, 0.6), 0.4),
        ((-3.0, 4.0, 1.0), 5.0),
        ((5.0, 4.0, 1.0), 5.0),
    ],
)
def test_distance_from_a_lane(point, distance):
    assert Line((0.0, 0.0, 1.0), (2.0, 0.0, 1.0)).distance(point) == pytest.approx(distance)


@given(WIDTH, WIDTH, st.floats(0.2, 1.0))
def test_a_swath_wider_than_the_lanes_covers_all(length, width, lane_width):
    area = Area(x_min=0.0, x_max=length, y_min=0.0, y_max=width)
    path = sweep(area, lane_width, 1.0)
    coverage = Coverage(area, cell=0.1, swath=1.5 * lane_width)
    count = int(path.length / (0.1 * lane_width)) + 2
    for k in range(count + 1):
        coverage.add(path.at(path.length * k / count)[0])
    assert coverage.share == 1.0
