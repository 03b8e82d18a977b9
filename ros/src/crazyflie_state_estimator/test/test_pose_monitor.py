"""Poses that a vehicle cannot have flown to, and tilt."""

import math
from random import Random

import pytest

from crazyflie_state_estimator.pose_monitor import PoseMonitor, TiltMonitor, Verdict

GOOD, BAD = Verdict.GOOD, Verdict.IMPOSSIBLE


def judge(max_speed=5.0):
    """Return ``verdict(time, position)`` of a monitor that knows no control."""
    monitor = PoseMonitor(max_speed, knows_control=True)
    return lambda time, position: monitor.update(time, position, (0.0, 0.0, 0.0, 1.0), None)


def test_wild_poses_are_not_believed_where_the_vehicle_might_be():
    verdict = judge()
    random = Random(1)
    assert verdict(0.0, (0.0, 0.0, 1.0)) is GOOD
    believed = [
        verdict(0.1 + k / 200, (random.uniform(-3, 3), 0.0, random.uniform(0, 4)))
        for k in range(800)
    ]
    assert set(believed) == {BAD}
    after = [verdict(4.2 + k / 200, (0.1, 0.0, 1.0)) for k in range(4)]
    assert after == [
        BAD,
        BAD,
        GOOD,
        GOOD,
    ]


@pytest.mark.parametrize(
    ("distance", "expected"),
    [(2.5, GOOD), (2.6, BAD)],
)
def test_a_vehicle_that_was_away_for_long_has_flown_on_for_half_a_second(distance, expected):
    verdict = judge()
    assert verdict(0.0, (0.0, 0.0, 1.0)) is GOOD
    assert verdict(3.0, (distance, 0.0, 1.0)) is expected


def test_a_pose_may_be_as_far_away_as_noise_brings_it_at_once():
    verdict = judge()
    assert verdict(1.0, (0.0, 0.0, 0.0)) is GOOD
    assert verdict(1.0, (0.02, 0.0, 0.0)) is GOOD
    assert verdict(1.0, (0.05, 0.0, 0.0)) is BAD


@pytest.mark.parametrize(("time", "expected"), [(0.029, GOOD), (0.03, BAD)])
def test_after_an_outlier_a_single_pose_counts_for_30_ms(time, expected):
    for begin in (0.0, 64.0):
        verdict = judge()
        verdict(begin, (0.0, 0.0, 1.0))
        assert verdict(begin + 0.01, (3.0, 0.0, 1.0)) is BAD
        assert verdict(begin + time, (0.0, 0.0, 1.0)) is expected


def test_a_vehicle_that_was_carried_is_found_again_after_three_tenths_of_a_second():
    verdict = judge(1.0)
    verdict(0.0, (0.0, 0.0, 0.0))
    found = [verdict(time, (9.0, 0.0, 0.0)) for time in (1.0, 1.1, 1.2, 1.29, 1.3, 1.31)]
    assert found == [BAD, BAD, BAD, BAD, Verdict.MOVED, GOOD]


def test_a_vehicle_has_tipped_over_with_five_poses_in_a_row():
    monitor = TiltMonitor(math.radians(60.0))
    # Unit quaternions of a tilt of 59 and 61 degrees about an axis between x and y.
    level, tilted = (
        (0.6 * math.sin(math.radians(each)), 0.8 * math.sin(math.radians(each)))
        for each in (29.5, 30.5)
    )
    assert not any(monitor.update(*pose) for pose in [level, *[tilted] * 4, level, *[tilted] * 4])
    assert monitor.update(*tilted)
    assert all(monitor.update(*pose) for pose in [tilted, *[level] * 4, tilted, *[level] * 4])
    assert not monitor.update(*level)
