"""A sweep: its reference, its coverage and its tracking error."""

import math

import pytest

from crazyflie_sweep.sweep_parameters import Area, SweepPlan
from crazyflie_sweep.sweeper import Coverage, Sweeper
from crazyflie_sweep.velocities import oscillator_velocity

AREA = Area(x_min=0.0, x_max=2.0, y_min=-1.0, y_max=0.0)


def test_nothing_is_covered_at_first():
    coverage = Coverage(AREA, 0.1, 0.5)
    assert coverage.share == 0.0
    assert coverage.middles(covered=False).shape == (200, 2)
    assert coverage.middles(covered=True).shape == (0, 2)


def test_a_disc_covers_its_area():
    coverage = Coverage(AREA, 0.01, 0.8)
    assert coverage.add((1.0, -0.5, 1.0))
    assert coverage.share == pytest.approx(math.pi * 0.4**2 / 2.0, rel=0.01)


def test_the_same_place_again_is_nothing_new():
    coverage = Coverage(AREA, 0.1, 0.5)
    coverage.add((1.0, -0.5, 1.0))
    share = coverage.share
    assert not coverage.add((1.0, -0.5, 2.0))
    assert not coverage.add((10.0, -0.5, 1.0))
    assert coverage.share == share


def test_cells_fill_the_area_when_their_width_does_not_divide_it():
    coverage = Coverage(AREA, 0.3, 0.5)
    assert coverage.cell_size == pytest.approx((2.0 / 7, 1.0 / 4))
    middles = coverage.middles(covered=False)
    assert middles.min(axis=0) == pytest.approx((1.0 / 7, -1.0 + 1.0 / 8))
    assert middles.max(axis=0) == pytest.approx((2.0 - 1.0 / 7, -1.0 / 8))


PLAN = {"area/y_min": -1.0, "area/y_max": 1.0}  #: Of the parameters, what is not the default.

START = (0.0, 0.0, 0.6)
DT = 0.02
LIMIT = 300.0


def make(start=START, **parameters):
    """Return a sweeper; a parameter's name has __ in place of /."""
    given = {name.replace("__", "/"): value for name, value in parameters.items()}
    return Sweeper(SweepPlan.from_mapping({**PLAN, **given}), start)


def fly(sweeper, off=(0.0, 0.0, 0.0), velocity=None):
    """Fly to the end with a vehicle that is off the reference; return the references."""
    references = []
    while not sweeper.is_done:
        reference = sweeper.reference
        references.append(reference)
        x, y, z = (r + o for r, o in zip(reference, off, strict=False))
        sweeper.measure((x, y, z))
        v = oscillator_velocity(sweeper.service_position(x)) if velocity is None else velocity
        sweeper.advance(DT, v)
        assert len(references) < LIMIT / DT
    return references


def test_covers_the_area():
    sweeper = make()
    references = fly(sweeper)
    assert sweeper.coverage.share == 1.0
    assert sweeper.is_covered
    assert sweeper.max_lane_distance == pytest.approx(0.0, abs=1e-9)
    assert references[0][:3] == START
    assert references[-1][:2] == pytest.approx((-1.5, 0.75), abs=0.02)
    assert sweeper.speed == 0.0


def test_velocities_are_those_of_the_positions_and_bounded():
    references = fly(make())
    for a, b in zip(references, references[1:], strict=False):
        speed = math.hypot(*b[3:])
        assert speed <= 0.7 + 1e-9
        # At the corner from the approach into the first lane a step is shorter than its arc.
        assert math.dist(a[:3], b[:3]) <= speed * DT + 1e-9
        assert abs(speed - math.hypot(*a[3:])) <= 0.5 * DT + 1e-9


def test_goes_through_the_oscillators_velocities_on_a_lane():
    sweeper = make(speed__max=2.0, speed__acceleration=5.0)
    seen = {}
    while not sweeper.is_done:
        if sweeper.lane is not None and sweeper.reference[1] == -0.75:
            seen[round(sweeper.reference[0], 1)] = sweeper.speed
        sweeper.advance(DT, oscillator_velocity(sweeper.service_position(sweeper.reference[0])))
    # Lanes of 3 m stand for 7: everything is 3/7 as large.
    assert seen[0.0] == pytest.approx(3.0 / 7.0 * 2.1, rel=0.01)
    assert seen[-1.0] == pytest.approx(3.0 / 7.0 * 1.1, rel=0.1)
    assert seen[1.0] == pytest.approx(3.0 / 7.0 * 1.1, rel=0.1)


def test_service_position_scales_the_lane_to_the_interval():
    sweeper = make()
    ends = [sweeper.service_position(x) for x in (-1.5, 0.0, 1.5)]
    assert ends == pytest.approx([2.0, 5.5, 9.0])
    assert sweeper.service_position(-2.0) == 2.0
    assert sweeper.service_position(7.0) == 9.0


def test_without_a_velocity_it_brakes_and_stays():
    sweeper = make()
    while not (sweeper.lane is not None and sweeper.speed > 0.5):
        sweeper.advance(DT, 2.0)
    before = sweeper.reference
    for _ in range(200):
        sweeper.advance(DT, None)
    # v^2 / 2 a, with a tick's worth more.
    assert sweeper.reference[0] - before[0] == pytest.approx(before[3] ** 2 / (2 * 0.5), abs=0.02)
    rest = sweeper.reference
    assert rest[3:] == (0.0, 0.0, 0.0)
    sweeper.advance(DT, None)
    assert sweeper.reference == rest
    sweeper.advance(DT, 2.0)
    assert sweeper.speed > 0.0


def test_measures_the_largest_distance_on_lanes_only():
    sweeper = make()
    fly(sweeper, off=(0.0, 0.03, -0.04))
    assert sweeper.max_lane_distance == pytest.approx(0.05)


def test_a_second_pass_leads_back_and_the_last_one_ends():
    sweeper = make(coverage__swath=0.3)
    references = fly(sweeper)
    assert not sweeper.is_covered
    assert sweeper.coverage.share < 0.8
    assert references[-1][:2] == pytest.approx((-1.5, -0.75), abs=0.02)
    once = fly(make(coverage__swath=0.3, coverage__max_passes=1))
    assert len(references) > 1.7 * len(once)


def test_a_vehicle_that_is_there_needs_no_approach():
    sweeper = make((-1.5, -0.75, 1.0))
    assert sweeper.lane is not None
    assert sweeper.reference[:3] == (-1.5, -0.75, 1.0)


def test_slower_or_faster_than_allowed_is_neither():
    for velocity, speed in ((0.01, 0.1), (100.0, 0.7)):
        references = fly(make((-1.5, -0.75, 1.0)), velocity=velocity)
        speeds = [math.hypot(*r[3:]) for r in references if abs(r[0]) < 0.3]
        assert speeds == pytest.approx([speed] * len(speeds))
