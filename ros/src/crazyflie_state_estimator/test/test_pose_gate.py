"""Poses that a vehicle cannot have flown to."""

from random import Random

from crazyflie_state_estimator.pose_gate import PoseGate, Verdict


def test_wild_poses_are_not_believed_where_the_vehicle_might_be():
    gate = PoseGate(5.0)
    random = Random(1)
    assert gate.judge(0.0, (0.0, 0.0, 1.0)) is Verdict.GOOD
    believed = [
        gate.judge(0.1 + k / 200, (random.uniform(-3, 3), 0.0, random.uniform(0, 4)))
        for k in range(800)
    ]
    assert set(believed) == {Verdict.BAD}
    after = [gate.judge(4.2 + k / 200, (0.1, 0.0, 1.0)) for k in range(4)]
    assert after == [Verdict.BAD, Verdict.BAD, Verdict.GOOD, Verdict.GOOD]
