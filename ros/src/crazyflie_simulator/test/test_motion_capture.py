"""Errors of a motion capture system."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from crazyflie_simulator.vehicle import MotionCapture

POSE = ((1.0, 2.0, 3.0), (0.5, 0.5, 0.5, 0.5))


def measured(count, **errors):
    """Return the arrivals of poses at 0.01 s, 0.02 s, ... that do not change."""
    motion_capture = MotionCapture(**errors)
    arrivals = []
    for k in range(1, count + 1):
        motion_capture.measure(0.01 * k, *POSE)
        arrivals.append(motion_capture.arrivals(0.01 * k))
    return arrivals


def test_perfect_by_default():
    assert measured(3) == [[(0.01 * k, *POSE)] for k in (1, 2, 3)]


def test_position_noise_has_its_spread():
    positions = np.array([arrived[0][1] for arrived in measured(4000, position_noise=0.001)])
    np.testing.assert_allclose(positions.mean(axis=0), POSE[0], atol=1e-4)
    np.testing.assert_allclose(positions.std(axis=0), 0.001, rtol=0.05)


def test_attitude_noise_is_a_small_rotation_in_the_body_frame():
    quaternions = [arrived[0][2] for arrived in measured(4000, attitude_noise=0.02)]
    errors = (Rotation.from_quat(POSE[1]).inv() * Rotation.from_quat(quaternions)).as_rotvec()
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=2e-3)
    np.testing.assert_allclose(errors.std(axis=0), 0.02, rtol=0.05)


@given(latency=st.floats(0.0, 0.05))
def test_latency_delays_but_keeps_stamps_and_order(latency):
    arrivals = measured(20, latency=latency)
    late = sum(not arrived for arrived in arrivals)
    assert 0.01 * late == pytest.approx(latency, abs=0.01 + 1e-9)
    assert 0.01 * late >= latency - 1e-6
    stamps = [stamp for arrived in arrivals for stamp, _, _ in arrived]
    assert stamps == [0.01 * k for k in range(1, 21 - late)]


def test_dropout_loses_its_share():
    arrived = sum(len(arrived) for arrived in measured(4000, dropout=0.3))
    assert arrived == pytest.approx(2800, rel=0.05)
    assert sum(len(arrived) for arrived in measured(50, dropout=1.0)) == 0


def test_the_seed_decides():
    errors = {"position_noise": 0.01, "attitude_noise": 0.01, "dropout": 0.2, "latency": 0.02}
    assert measured(50, seed=(1, 2), **errors) == measured(50, seed=(1, 2), **errors)
    assert measured(50, seed=(1, 2), **errors) != measured(50, seed=(1, 3), **errors)


def test_a_reset_of_the_clock_loses_what_is_on_the_way():
    motion_capture = MotionCapture(latency=0.05)
    motion_capture.measure(100.0, *POSE)
    motion_capture.measure(1.0, *POSE)
    assert [stamp for stamp, _, _ in motion_capture.arrivals(1.06)] == [1.0]
