"""The gain files that come with the package: their numbers, and what they can take."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from crazyflie_lqr.gain_file import load_matrix, load_vector
from crazyflie_lqr.margins import flown, loop_margins
from crazyflie_lqr.models import full_state, near_hover

CONFIG = Path(__file__).parents[1] / "config"
REFERENCES = Path(__file__).parents[1] / "references"
G = 9.81
FULL = load_matrix(str(CONFIG / "K_full_state.txt"), 4, 12)


def gains(tilt, tilt_rate, yaw, lift, lift_rate):
    """Return gains with the signs of u = +K e."""
    K = np.zeros((4, 7))
    K[0, [1, 4]] = tilt, tilt_rate
    K[1, [0, 3]] = -tilt, -tilt_rate
    K[2, 6] = -yaw
    K[3, [2, 5]] = -lift, -lift_rate
    return K


def test_hover_gains_have_the_closed_form_of_their_weights():
    K = load_matrix(str(CONFIG / "K_hover.txt"), 4, 7)
    tilt, lift = 1.0 / 0.1, 2.0 / 0.1
    expected = gains(
        tilt,
        math.sqrt((1.0 / 0.1) ** 2 + 2.0 * tilt / G),
        10.0 / 0.1,
        lift,
        math.sqrt((2.0 / 0.1) ** 2 + 2.0 * lift),
    )
    np.testing.assert_allclose(K, expected, rtol=1e-9)


def test_soft_gains_are_the_hardware_ones():
    K = load_matrix(str(CONFIG / "K_soft.txt"), 4, 7)
    np.testing.assert_allclose(K, gains(0.25, 1.0, 3.5, 1.5, 1.0), rtol=1e-9)


def test_quadrotor_gains_have_the_closed_form_of_their_weights():
    K = load_matrix(str(CONFIG / "K_quadrotor.txt"), 4, 7)
    tilt, lift = math.sqrt(2.0 / 4.0), math.sqrt(16.0 / 0.0625)
    expected = gains(
        tilt,
        math.sqrt(0.5 / 4.0 + 2.0 * tilt / G),
        math.sqrt(100.0 / 9.0),
        lift,
        math.sqrt(3.0 / 0.0625 + 2.0 * lift),
    )
    np.testing.assert_allclose(K, expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("file", "plant"),
    [
        (CONFIG / "K_sim.txt", near_hover()),
        (CONFIG / "K_soft.txt", full_state()),
        (CONFIG / "K_quadrotor.txt", full_state()),
        (CONFIG / "K_full_state.txt", full_state()),
        (REFERENCES / "K_manual.txt", full_state()),
    ],
    ids=lambda each: getattr(each, "name", ""),
)
def test_gains_of_launch_files_bear_60_ms_of_delay(file, plant):
    states = full_state().states if "full_state" in file.name else near_hover().states
    loop = flown(load_matrix(str(file), 4, len(states)), states, plant)
    for each in range(4):
        margins = loop_margins(loop, each)
        assert margins.delay >= 0.06
        assert margins.modulus >= 0.5


def test_reference_control_is_hover():
    np.testing.assert_array_equal(load_vector(str(CONFIG / "u_ref_hover.txt"), 4), [0, 0, 0, G])


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("K_lqr", (10.0, 1.74, 100.0, 200.0, 28.28)),
        ("K_manual", (0.25, 1.0, 3.5, 1.5, 1.0)),
        ("K_poor", (0.5, 0.5, 3.5, 1.0, 1.0)),
    ],
)
def test_reference_gains_are_the_documented_ones(name, numbers):
    K = load_matrix(str(REFERENCES / f"{name}.txt"), 4, 7)
    np.testing.assert_array_equal(K, gains(*numbers))


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("u_ref_hover", [0, 0, 0, G]),
        ("x_ref_hover", [0, 0, 0.7, 0, 0, 0]),
        ("x_ref_hover_sim", [0, 0, 5, 0, 0, 0]),
    ],
)
def test_reference_vectors_are_the_documented_ones(name, numbers):
    vector = load_vector(str(REFERENCES / f"{name}.txt"), len(numbers))
    np.testing.assert_array_equal(vector, numbers)


@pytest.mark.parametrize("file", [*CONFIG.glob("*.txt"), *REFERENCES.glob("*.txt")], ids=str)
def test_numbers_come_before_comments(file):
    # The reader of the C++ workspace stops at the first comment.
    lines = [line.startswith("#") for line in file.read_text().splitlines()]
    assert lines == sorted(lines)


def attitude_loop(rate_bandwidth):
    """Return A, B of a vehicle with the states of the full one and a second-order attitude."""
    A, B = np.zeros((12, 12)), np.zeros((12, 4))
    A[[0, 1, 2, 6, 7, 8], [3, 4, 5, 9, 10, 11]] = 1.0
    A[3, 7], A[4, 6], B[5, 3] = G, -G, 1.0
    for angle, rate, control in ((6, 9, 0), (7, 10, 1)):
        A[rate, angle], A[rate, rate] = -6.0 * rate_bandwidth, -rate_bandwidth
        B[rate, control] = 6.0 * rate_bandwidth
    A[11, 11], B[11, 2] = -10.0, 10.0
    return A, B


@pytest.mark.parametrize("yaw_deg", range(0, 360, 15))
@pytest.mark.parametrize("rate_bandwidth", [15.0, 30.0, 100.0])
def test_full_state_gains_fly_at_any_yaw(yaw_deg, rate_bandwidth):
    # Attitude is measured about fixed axes, commanded about the heading's.
    c, s = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    measured = np.eye(12)
    for angle in (6, 9):
        measured[angle : angle + 2, angle : angle + 2] = [[c, s], [-s, c]]
    A, B = attitude_loop(rate_bandwidth)
    assert np.linalg.eigvals(A + B @ FULL @ measured).real.max() < -0.3


@pytest.mark.parametrize("late", [0, 1, 3])
def test_full_state_gains_fly_where_attitude_follows_at_once(late):
    # A sampled loop of 10 ms in which the measured tilt is the control that acts,
    # and all rates are differences of two measurements.
    dt = 0.01
    A, B = np.zeros((7, 7)), np.zeros((7, 4))
    A[[0, 1, 2], [3, 4, 5]] = 1.0
    B[3, 1], B[4, 0], B[5, 3], B[6, 2] = G, -G, 1.0, 1.0
    step = expm(np.block([[A, B], [np.zeros((4, 11))]]) * dt)

    def advance(everything):
        x, previous, controls = np.split(everything, [7, 13])
        acting = controls[-4:]
        pose = np.concatenate([x[:3], acting[:2], x[6:]])
        rates = (pose - previous) / dt
        u = FULL @ np.concatenate([pose[:3], rates[:3], pose[3:], rates[3:]])
        controls = np.concatenate([u, controls])
        acting = controls[4 * late : 4 * late + 4]
        x = (step @ np.concatenate([x, acting]))[:7]
        return np.concatenate([x, pose, controls[: 4 * (late + 1)]])

    loop = np.array([advance(unit) for unit in np.eye(13 + 4 * (late + 1))]).T
    assert np.abs(np.linalg.eigvals(loop)).max() < 1.0
