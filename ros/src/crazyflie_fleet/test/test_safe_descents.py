"""Descents of single vehicles next to those beneath them, by figures calculated by hand."""

import numpy as np
import pytest

from crazyflie_fleet.landing_rounds import SafeDescents

#: One above another, and a third far from both; buffers are 0.15 m each.
PLACES = np.array([(0.0, 0.0, 2.0), (0.1, 0.0, 1.0), (5.0, 5.0, 1.0)])
IN_FLIGHT = np.zeros(3, dtype=bool)

#: To a place 0.3 m aside: 1.1 times sqrt(10/sqrt(3) 0.3 m / 2 m/s^2).
DURATION = 1.0237


@pytest.fixture
def descents():
    return SafeDescents([0.15] * 3)


def test_a_vehicle_with_nothing_beneath_lands_where_it_is(descents):
    for number in (1, 2):
        assert descents.begin(number, 7.0, PLACES, IN_FLIGHT) == 0.0
        assert descents.reference(number, 7.1, 0.9, -0.3) is None


def test_a_vehicle_flies_beside_the_one_beneath_it_while_it_sinks(descents):
    assert descents.begin(0, 7.0, PLACES, IN_FLIGHT) == pytest.approx(0.3)

    def reference(time):
        return np.array(descents.reference(0, time, 2.0 - 0.3 * (time - 7.0), -0.3))

    assert reference(7.0) == pytest.approx([*PLACES[0], 0.0, 0.0, 0.0])
    half, end = reference(7.0 + DURATION / 2.0), reference(7.0 + 1.01 * DURATION)
    assert np.linalg.norm(half[:2]) == pytest.approx(0.15, abs=1e-3)
    # Half of what the straight descent has done.
    assert half[2] == pytest.approx(2.0 - 0.15 * DURATION / 2.0, abs=1e-3)
    assert np.linalg.norm(end[:2]) == pytest.approx(0.3)
    assert np.linalg.norm(end[:2] - PLACES[1, :2]) >= 0.315
    assert reference(9.0)[2:] == pytest.approx([1.4, 0.0, 0.0, -0.3])
    for time in np.linspace(7.01, 7.0 + DURATION, 9):
        change = (reference(time + 1e-4) - reference(time - 1e-4))[:3] / 2e-4
        assert reference(time)[3:] == pytest.approx(change, abs=1e-3)


def test_a_descent_is_under_way_as_long_as_references_come(descents):
    assert not descents.is_under_way(0, 7.0)
    descents.begin(0, 7.0, PLACES, IN_FLIGHT)
    under_way = [descents.is_under_way(0, time) for time in (6.9, 7.0, 7.49, 7.5)]
    assert under_way == [False, True, True, False]
    descents.reference(0, 7.4, 1.9, -0.3)
    assert descents.is_under_way(0, 7.8)
    assert not descents.is_under_way(1, 7.8)


def test_a_vehicle_that_flies_aside_counts_at_its_landing_place(descents):
    above = np.array([(0.0, 0.0, 2.0), (0.1, 0.0, 1.0), (0.0, 0.0, 3.0)])
    descents.begin(0, 7.0, above, np.array([True, False, False]))
    place = np.array(descents.reference(0, 9.0, 1.4, -0.3)[:2])
    # Above that place, which is as far from the others as both buffers.
    above[2, :2] = place
    landing = np.array([True, False, True])
    assert descents.begin(2, 9.4, above, landing) >= 0.3
    # When its references have ended, its own position is used.
    assert descents.begin(2, 20.0, above, landing) == 0.0


def test_vehicles_whose_positions_are_unknown_do_not_count():
    unknown = [np.nan] * 3
    descents = SafeDescents([0.9, 0.15, 0.15])
    assert descents.begin(2, 0.0, np.array([unknown, *PLACES[1::-1]]), IN_FLIGHT) == pytest.approx(
        0.3
    )
    assert descents.begin(1, 0.0, np.array([PLACES[1], *[unknown] * 2]), IN_FLIGHT) == 0.0
    assert descents.reference(1, 0.1, 0.9, -0.3) is None
