"""Poses that a vehicle cannot have flown to."""

from random import Random

import pytest

from crazyflie_state_estimator.pose_gate import Classification, PoseGate


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
