"""Poses that a vehicle cannot have flown to."""

import math
from random import Random

import pytest

from crazyflie_state_estimator.pose_gate import Classification, PoseGate, TiltMonitor


def test_wild_poses_are_not_believed_where_the_vehicle_might_be():
    gate = PoseGate(5.0)
    random = Random(1)
    assert gate.classify(0.0, (0.0, 0.0, 1.0)) is Classification.GOOD
    believed = [
        gate.classify(0.1 + k / 200, (random.uniform(-3, 3), 0.0, random.uniform(0, 4)))
        for k in range(800)
    ]
    assert set(believed) == {Classification.BAD}
    after = [gate.classify(4.2 + k / 200, (0.1, 0.0, 1.0)) for k in range(4)]
    assert after == [
        Classification.BAD,
        Classification.BAD,
        Classification.GOOD,
        Classification.GOOD,
    ]


@pytest.mark.parametrize(
    ("distance", "classification"),
    [(2.5, Classification.GOOD), (2.6, Classification.BAD)],
)
def test_a_vehicle_that_was_away_for_long_has_flown_on_for_half_a_second(distance, classification):
    gate = PoseGate(5.0)
    assert gate.classify(0.0, (0.0, 0.0, 1.0)) is Classification.GOOD
    assert gate.classify(3.0, (distance, 0.0, 1.0)) is classification


def test_a_pose_may_be_as_far_away_as_noise_brings_it_at_once():
    gate = PoseGate(5.0)
    assert gate.classify(1.0, (0.0, 0.0, 0.0)) is Classification.GOOD
    assert gate.classify(1.0, (0.02, 0.0, 0.0)) is Classification.GOOD
    assert gate.classify(1.0, (0.05, 0.0, 0.0)) is Classification.BAD
    assert gate.rejected == 1


@pytest.mark.parametrize(
    ("time", "classification"), [(0.029, Classification.GOOD), (0.03, Classification.BAD)]
)
def test_after_an_outlier_a_single_pose_counts_for_30_ms(time, classification):
    for begin in (0.0, 64.0):
        gate = PoseGate(5.0)
        gate.classify(begin, (0.0, 0.0, 1.0))
        assert gate.classify(begin + 0.01, (3.0, 0.0, 1.0)) is Classification.BAD
        assert gate.classify(begin + time, (0.0, 0.0, 1.0)) is classification


def test_a_vehicle_that_was_carried_is_found_again_after_three_tenths_of_a_second():
    gate = PoseGate(1.0)
    gate.classify(0.0, (0.0, 0.0, 0.0))
    found = [gate.classify(time, (9.0, 0.0, 0.0)) for time in (1.0, 1.1, 1.2, 1.29, 1.3, 1.31)]
    bad, good = Classification.BAD, Classification.GOOD
    assert found == [bad, bad, bad, bad, Classification.MOVED, good]
    assert gate.rejected == 4


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
