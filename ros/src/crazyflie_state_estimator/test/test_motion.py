"""The motion estimator with finite differences, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_state_estimator.motion import FiniteDifference, MotionEstimator

MS = 1_000_000
DAY = 1_700_000_000_000_000_000
LEVEL = (0.0, 0.0, 0.0)


def estimator():
    return MotionEstimator(FiniteDifference(), FiniteDifference())


def last_motion(poses):
    """Return what the last of several (stamp, position, attitude) gives."""
    subject = estimator()
    for pose in poses:
        motion = subject.update(*pose)
    return motion


finite = st.floats(-1e3, 1e3)
vectors = st.tuples(finite, finite, finite)
angles = st.floats(-math.pi, math.pi)
intervals = st.integers(MS, 1000 * MS)


@given(vectors, vectors, st.integers(0, DAY), intervals)
def test_linear_motion_is_exact(start, velocity, stamp, interval):
    start, velocity = np.array(start), np.array(velocity)
    motion = last_motion(
        [(stamp, start, LEVEL), (stamp + interval, start + velocity * interval * 1e-9, LEVEL)]
    )
    np.testing.assert_allclose(motion.position, start + velocity * interval * 1e-9)
    # Positions of 1000 m are known to 1e-13 m, and intervals are 1 ms or more.
    np.testing.assert_allclose(motion.velocity, velocity, rtol=1e-9, atol=1e-9)


def test_the_second_of_two_poses_gives_the_first_motion():
    subject = estimator()
    assert subject.update(DAY, (0.0, 0.0, 1.0), LEVEL) is None
    motion = subject.update(DAY + 10 * MS, (0.02, -0.01, 1.0), (0.0, 0.0, 0.1))
    np.testing.assert_allclose(motion.velocity, [2.0, -1.0, 0.0])
    np.testing.assert_allclose(motion.attitude, [0.0, 0.0, 0.1])
    np.testing.assert_allclose(motion.attitude_rate, [0.0, 0.0, 10.0])


def test_quadratic_motion_gives_the_velocity_half_an_interval_ago():
    acceleration = np.array([1.0, -2.0, 0.5])
    subject = estimator()
    time, motions = 0, []
    for interval in (10, 7, 13, 2, 40):
        time += interval * MS
        position = 0.5 * acceleration * (time * 1e-9) ** 2
        motions.append((time - interval * MS / 2, subject.update(time, position, LEVEL)))
    for middle, motion in motions[1:]:
        np.testing.assert_allclose(motion.velocity, acceleration * middle * 1e-9)


@given(angles, st.floats(-3.0, 3.0))
def test_angles_are_differenced_across_the_jump(yaw, turn):
    after = math.remainder(yaw + turn, 2.0 * math.pi)
    motion = last_motion([(0, LEVEL, (0, 0, yaw)), (500 * MS, LEVEL, (0, 0, after))])
    assert motion.attitude_rate[2] == pytest.approx(turn / 0.5, abs=1e-9)
    assert math.cos(motion.attitude[2] - after) == pytest.approx(1.0)
    assert abs(motion.attitude[2]) <= math.pi


def test_many_turns_keep_rate_and_angle():
    subject = estimator()
    for k in range(2000):
        yaw = math.remainder(0.5 * k, 2.0 * math.pi)
        motion = subject.update(k * 100 * MS, LEVEL, (0.0, 0.0, yaw))
    assert motion.attitude_rate[2] == pytest.approx(5.0)
    assert motion.attitude[2] == pytest.approx(yaw)


@given(st.integers(1, 4 * MS), st.floats(-0.02, 0.02))
def test_two_poses_that_came_together_are_no_speed(gap, error):
    # A pose every 10 ms at 1 m/s; one is stamped just before its successor, with some noise.
    subject = MotionEstimator(FiniteDifference(0.005), FiniteDifference(0.005))
    speeds = []
    stamps = [0, 10 * MS, 20 * MS, 40 * MS - gap, 40 * MS, 50 * MS, 60 * MS]
    for number, stamp in enumerate(stamps):
        moved = error if number == 3 else 0.0
        motion = subject.update(stamp, (0.01 * number + moved, 0.0, 0.0), LEVEL)
        speeds.append(0.0 if motion is None else motion.velocity[0])
        if motion is not None:
            assert motion.position[0] == 0.01 * number + moved
    assert max(map(abs, speeds)) < 4.0


def test_poses_that_come_too_often_give_the_rate_over_several():
    subject = MotionEstimator(FiniteDifference(0.005), FiniteDifference(0.005))
    motions = [subject.update(k * MS, (0.002 * k, 0.0, 0.0), LEVEL) for k in range(20)]
    assert [motion.velocity[0] for motion in motions[5:]] == pytest.approx([2.0] * 15)


def test_a_repeated_stamp_gives_nothing_and_changes_nothing():
    subject = estimator()
    subject.update(0, (0.0, 0.0, 0.0), LEVEL)
    assert subject.update(0, (9.0, 9.0, 9.0), LEVEL) is None
    motion = subject.update(10 * MS, (0.01, 0.0, 0.0), LEVEL)
    np.testing.assert_allclose(motion.velocity, [1.0, 0.0, 0.0])


def test_time_that_goes_back_restarts():
    subject = estimator()
    subject.update(DAY, (5.0, 0.0, 0.0), LEVEL)
    subject.update(DAY + 10 * MS, (5.0, 0.0, 0.0), LEVEL)
    assert subject.update(50 * MS, (1.0, 0.0, 0.0), LEVEL) is None
    motion = subject.update(60 * MS, (1.02, 0.0, 0.0), LEVEL)
    np.testing.assert_allclose(motion.velocity, [2.0, 0.0, 0.0])


def test_reset_forgets_the_past():
    subject = estimator()
    subject.update(0, (5.0, 0.0, 0.0), LEVEL)
    subject.reset()
    assert subject.update(10 * MS, (1.0, 0.0, 0.0), LEVEL) is None
    assert subject.update(20 * MS, (1.0, 0.0, 0.0), LEVEL).velocity[0] == 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_pose_that_is_not_finite_changes_nothing(bad):
    subject = estimator()
    subject.update(0, (0.0, 0.0, 0.0), LEVEL)
    assert subject.update(10 * MS, (0.0, bad, 0.0), LEVEL) is None
    assert subject.update(10 * MS, (0.0, 0.0, 0.0), (bad, 0.0, 0.0)) is None
    motion = subject.update(20 * MS, (0.02, 0.0, 0.0), LEVEL)
    np.testing.assert_allclose(motion.velocity, [1.0, 0.0, 0.0])


poses = st.tuples(
    st.integers(0, 20),
    st.tuples(st.floats(), st.floats(), st.floats()),
    st.tuples(st.floats(), angles, angles),
)


@given(st.lists(poses, max_size=20))
def test_whatever_comes_every_motion_is_finite(sequence):
    subject = estimator()
    for stamp, position, attitude in sequence:
        motion = subject.update(stamp * MS, position, attitude)
        assert motion is None or all(np.isfinite(part).all() for part in motion)


def test_angles_end_within_half_a_turn():
    motion = last_motion([(0, LEVEL, (4.0, -4.0, 7.0)), (MS, LEVEL, (4.0, -4.0, 7.0))])
    full = 2.0 * math.pi
    assert motion.attitude == pytest.approx([4.0 - full, full - 4.0, 7.0 - full])
    assert motion.attitude_rate == pytest.approx([0.0] * 3, abs=1e-9)
