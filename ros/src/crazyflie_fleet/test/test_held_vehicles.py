"""Who is held, by figures that are calculated by hand; heights count half (DOWNWASH is 2)."""

import numpy as np
import pytest

from crazyflie_fleet.separation import Separation

STILL = np.zeros((2, 3))
#: Far from the origin, 0.2 m apart in y and z; in z only half of it is counted.
FIRST = np.array([5.0, -3.0, 2.0])
SECOND = FIRST + [0.0, 0.2, 0.2]


def held(goals, positions=(FIRST, SECOND), buffers=(0.15, 0.15)):
    """Return which of two vehicles at rest are held."""
    return Separation(buffers).update(np.array(positions), STILL, np.array(goals))[0].tolist()


def test_the_distance_of_a_pair_counts_heights_half():
    positions = np.array([[5.0, -3.0, 2.0], [5.03, -2.96, 2.24]])
    ((first, second, distance, limit),) = Separation([0.2, 0.15]).update(
        positions, STILL, positions
    )[1]
    assert (first, second) == (0, 1)
    # sqrt(3^2 + 4^2 + (24/2)^2) = 13.
    assert distance == pytest.approx(0.13)
    assert limit == pytest.approx(0.35)


def test_vehicles_that_stay_where_they_are_are_not_held():
    assert held([FIRST, SECOND]) == [False, False]


@pytest.mark.parametrize(
    ("step", "approaches"),
    [
        # 0.1 * 0.2 - 0.3/2 * 0.2/2 = 0.005; with heights in full or a quarter, it has other signs.
        ([0.0, 0.1, -0.3], True),
        ([0.0, 0.1, -0.5], False),
        ([0.0, -0.1, 0.3], False),
        ([0.0, -0.1, 0.5], True),
        # At right angles, in scaled coordinates.
        ([0.3, 0.0, 0.0], False),
    ],
)
def test_a_step_approaches_the_other_by_its_part_along_the_line_between_them(step, approaches):
    step = np.array(step)
    assert held([FIRST + step, SECOND]) == [approaches, False]
    assert held([FIRST, SECOND - step]) == [False, approaches]


def test_only_a_vehicle_that_was_held_needs_more_distance():
    apart = FIRST + np.array([[0.0, 0.0, 0.0], [0.0, 0.31, 0.0]])
    assert held(apart[::-1], apart) == [False, False]


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_position_with_an_unknown_coordinate_is_unknown(axis):
    unknown = SECOND.copy()
    unknown[axis] = np.nan
    separation = Separation([0.15, 0.15])
    assert separation.update(np.array([FIRST, unknown]), STILL, np.array([SECOND, FIRST]))[1] == []
