"""The Kalman filter against dense Gaussian estimation, Riccati's equation and closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

from crazyflie_state_estimator.motion import (
    ACCELERATION_WALK,
    ACCELERATION_WALK_WITH_CONTROL,
    MEMORY,
    POSITION_NOISE,
    ConstantAccelerationFilter,
)

NOISE, WALK, DT = 0.001, 3.0, 0.01


def run(subject, samples, dt=DT, accelerations=None):
    """Return values and rates, each (n, axes), that follow the first of the samples."""
    subject.start(np.array(samples[0], dtype=float))
    accelerations = [None] * len(samples) if accelerations is None else accelerations
    steps = [
        subject.step(dt, np.array(sample, dtype=float), acceleration)
        for sample, acceleration in zip(samples[1:], accelerations[1:], strict=True)
    ]
    return np.array([step[0] for step in steps]), np.array([step[1] for step in steps])


def transition(dt):
    return np.array([[1.0, dt, dt**2 / 2.0], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])


def walk_covariance(dt, walk, parts=200):
    """Return what white jerk adds in dt: the integral of its responses, by the midpoint rule."""
    ages = (np.arange(parts) + 0.5) * dt / parts
    responses = np.array([ages**2 / 2.0, ages, np.ones(parts)])
    return walk**2 * (dt / parts) * responses @ responses.T


def test_settles_at_the_solution_of_riccatis_equation():
    subject = ConstantAccelerationFilter(NOISE, WALK)
    run(subject, np.zeros((500, 1)))
    predicted = solve_discrete_are(
        transition(DT).T, np.array([[1.0], [0.0], [0.0]]), walk_covariance(DT, WALK), [[NOISE**2]]
    )
    gain = predicted[:, 0] / (predicted[0, 0] + NOISE**2)
    settled = predicted - np.outer(gain, predicted[0])
    np.testing.assert_allclose(subject.covariance, settled, rtol=1e-3)


@given(
    st.lists(
        st.tuples(st.floats(0.002, 0.5), st.floats(-1.0, 1.0)),
        min_size=1,
        max_size=8,
    )
)
def test_agrees_with_conditioning_all_samples_at_once(samples):
    """Everything is jointly Gaussian, so one dense solution gives the same mean."""
    noise, walk = 0.1, 2.0
    subject = ConstantAccelerationFilter(noise, walk)
    subject.start(np.array([0.5]))
    mean = np.array([0.5, 0.0, 0.0])
    prior = subject.covariance.copy()
    # Rows of `states`: how the state at each sample depends on (first state, walks).
    count = len(samples)
    state = np.hstack([np.eye(3), np.zeros((3, 3 * count))])
    covariance = np.zeros((3 + 3 * count, 3 + 3 * count))
    covariance[:3, :3] = prior
    rows, offsets = [], []
    for k, (dt, _) in enumerate(samples):
        state = transition(dt) @ state
        block = slice(3 + 3 * k, 6 + 3 * k)
        state[:, block] = np.eye(3)
        covariance[block, block] = walk_covariance(dt, walk)
        rows.append(state[0])
        mean = transition(dt) @ mean
        offsets.append(mean[0])
    seen = np.array(rows)
    innovations = np.array([value for _, value in samples]) - offsets
    expected = mean + state @ covariance @ seen.T @ np.linalg.solve(
        seen @ covariance @ seen.T + noise**2 * np.eye(count), innovations
    )
    for dt, value in samples:
        value, rate = subject.step(dt, np.array([value]))
    np.testing.assert_allclose([value[0], rate[0]], expected[:2], rtol=1e-3, atol=1e-3)


def test_the_second_sample_gives_the_difference_quotient():
    _, rates = run(ConstantAccelerationFilter(NOISE, WALK), [[0.0, 1.0], [0.01, 0.98]])
    np.testing.assert_allclose(rates[-1], [1.0, -2.0], rtol=0.01)


@pytest.mark.parametrize("power", [0, 1, 2])
def test_follows_polynomials_up_to_second_order_without_error(power):
    times = DT * np.arange(300)
    values, rates = run(ConstantAccelerationFilter(NOISE, WALK), times[:, None] ** power)
    assert values[-1, 0] == pytest.approx(times[-1] ** power, abs=1e-6)
    assert rates[-1, 0] == pytest.approx(power * times[-1] ** max(power - 1, 0), abs=1e-5)


def test_rate_noise_is_what_the_covariance_promises():
    rng = np.random.default_rng(3)
    jerk = WALK * np.sqrt(DT) * rng.normal(size=(4000, 50))
    # Truth and samples from the model itself; a walk at the samples only is close to it.
    acceleration = np.cumsum(jerk, axis=0)
    rate = DT * np.cumsum(acceleration, axis=0)
    signal = DT * np.cumsum(rate - DT * acceleration / 2.0, axis=0)
    subject = ConstantAccelerationFilter(NOISE, WALK)
    _, rates = run(subject, signal + NOISE * rng.normal(size=signal.shape))
    error = np.sqrt(np.mean((rates - rate[1:])[200:] ** 2))
    assert error == pytest.approx(math.sqrt(subject.covariance[1][1]), rel=0.1)


def test_a_known_acceleration_is_taken_over_at_once():
    times = DT * np.arange(400)
    known = np.where(times < 2.0, 0.0, 5.0)
    # The control given at a sample acts until the next.
    rate = DT * np.concatenate([[0.0], np.cumsum(known[:-1])])
    signal = np.concatenate([[0.0], np.cumsum(DT * rate[:-1] + DT**2 / 2.0 * known[:-1])])
    acting = [None, *[np.array([value]) for value in known[:-1]]]
    _, with_control = run(
        ConstantAccelerationFilter(NOISE, 1.0), signal[:, None], accelerations=acting
    )
    _, without = run(ConstantAccelerationFilter(NOISE, 1.0), signal[:, None])
    settled = slice(150, None)
    assert np.abs(with_control[settled, 0] - rate[1:][settled]).max() < 1e-3
    assert np.abs(without[settled, 0] - rate[1:][settled]).max() > 0.1


@pytest.mark.parametrize("frequency", [0.25, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("knows_acceleration", [False, True])
def test_the_rate_of_a_sine_lags_by_less_than_25_ms(frequency, knows_acceleration):
    omega = 2.0 * math.pi * frequency
    times = DT * np.arange(1000)
    signal = 4.0 / omega**2 * np.sin(omega * times)
    # Held from one sample to the next, the control is that of the middle.
    acting = [np.array([each]) for each in -4.0 * np.sin(omega * (times - DT / 2.0))]
    walk = ACCELERATION_WALK_WITH_CONTROL if knows_acceleration else ACCELERATION_WALK
    subject = ConstantAccelerationFilter(POSITION_NOISE, walk)
    _, rates = run(subject, signal[:, None], accelerations=acting if knows_acceleration else None)
    phases = omega * times[501:]
    in_phase, behind = 2.0 * np.mean(rates[500:].T * [np.cos(phases), np.sin(phases)], axis=1)
    assert math.atan2(behind, in_phase) / omega < 0.025
    assert math.hypot(in_phase, behind) == pytest.approx(4.0 / omega, rel=0.3)


@pytest.mark.parametrize("offset", [-3.0, 9.81])
def test_a_constant_offset_of_the_known_acceleration_does_no_harm(offset):
    signal = np.zeros((300, 1))
    acting = [None] * 100 + [np.array([offset])] * 100 + [None] * 100
    _, rates = run(ConstantAccelerationFilter(NOISE, WALK), signal, accelerations=acting)
    np.testing.assert_allclose(rates, 0.0, atol=1e-12)


def test_starts_afresh_after_a_pause():
    subject = ConstantAccelerationFilter(NOISE, WALK)
    run(subject, 0.5 * (DT * np.arange(200)[:, None]) ** 2)
    value, rate = subject.step(MEMORY + 1.0, np.array([4.0]))
    assert value[0] == 4.0
    assert rate[0] == pytest.approx((4.0 - 0.5 * 1.99**2) / 2.0, abs=1e-5)
    _, rate = subject.step(DT, np.array([4.05]))
    assert rate[0] == pytest.approx(5.0, rel=0.01)


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(1e-9, 1e9), st.floats(-1e3, 1e3)), max_size=50))
def test_covariance_stays_positive_and_estimates_finite(samples):
    subject = ConstantAccelerationFilter(NOISE, WALK)
    subject.start(np.array([0.0]))
    for dt, value in samples:
        estimates = subject.step(dt, np.array([value]))
        assert np.isfinite(estimates).all()
        assert np.linalg.eigvalsh(subject.covariance).min() > -1e-9
        assert np.diag(subject.covariance).min() >= 0.0


def continuous_wiener_covariance(dt, walk):
    """Return the integral of `walk_covariance` in closed form (Bar-Shalom et al., 6.2.3)."""
    return walk**2 * np.array(
        [
            [dt**5 / 20.0, dt**4 / 8.0, dt**3 / 6.0],
            [dt**4 / 8.0, dt**3 / 3.0, dt**2 / 2.0],
            [dt**3 / 6.0, dt**2 / 2.0, dt],
        ]
    )


def test_the_plain_floats_are_the_textbook_s_matrices():
    rng = np.random.default_rng(1)
    subject = ConstantAccelerationFilter(NOISE, WALK)
    subject.start([0.1, -0.2, 0.3])
    state = np.array([[0.1, -0.2, 0.3], [0.0] * 3, [0.0] * 3])
    covariance = np.array(subject.covariance)
    for _ in range(200):
        dt, sample = rng.uniform(0.005, 0.03), rng.normal(size=3)
        f = transition(dt)
        state = f @ state
        covariance = f @ covariance @ f.T + continuous_wiener_covariance(dt, WALK)
        gain = covariance[0] / (covariance[0, 0] + NOISE**2)
        state = state + np.outer(gain, sample - state[0])
        covariance = covariance - np.outer(gain, covariance[0])
        value, rate = subject.step(dt, sample)
        np.testing.assert_allclose([value, rate], state[:2], rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(subject.covariance, covariance, rtol=1e-9, atol=1e-12)


def test_at_the_first_sample_rate_and_acceleration_are_as_uncertain_as_was_given():
    subject = ConstantAccelerationFilter(0.5, WALK, 3.0, 5.0)
    subject.start([1.0])
    assert subject.covariance == [[0.25, 0.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 25.0]]
