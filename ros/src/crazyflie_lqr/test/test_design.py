"""Gains against Riccati equations, closed forms and a search for better ones."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are, solve_discrete_are, solve_discrete_lyapunov
from scipy.optimize import minimize

from crazyflie_lqr.design import Design, DesignError, Weights, design_gains, sampled
from crazyflie_lqr.models import LinearModel, full_state, near_hover

MODEL = near_hover()
Q = np.diag([1.0, 1.0, 2.0, 1.0, 1.0, 2.0, 10.0]) ** 2
R = np.diag([0.1, 0.1, 0.1, 0.1]) ** 2
NONE = np.zeros((7, 4))


def weights(q=Q, r=R, n=NONE):
    """Return weights."""
    return Weights(np.asarray(q), np.asarray(r), np.asarray(n))


def random_weights(model, seed):
    """Return weights that couple everything with everything."""
    rng = np.random.default_rng(seed)
    size = model.x_dim + model.u_dim
    factor = rng.normal(size=(size, size))
    joint = factor @ factor.T + 0.1 * np.eye(size)
    x = model.x_dim
    return Weights(joint[:x, :x], joint[x:, x:], joint[:x, x:])


@pytest.mark.parametrize("model", [near_hover(), full_state()])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_continuous_gains_solve_the_riccati_equation(model, seed):
    w = random_weights(model, seed)
    P = solve_continuous_are(model.A, model.B, w.Q, w.R, s=w.N)
    K = -np.linalg.solve(w.R, model.B.T @ P + w.N.T)
    design = design_gains(model, w)
    np.testing.assert_allclose(design.K, K, rtol=1e-6, atol=1e-8 * np.abs(K).max())
    assert design.poles.real.max() < 0.0


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_sampled_gains_solve_the_discrete_riccati_equation(seed):
    w = random_weights(MODEL, seed)
    A, B = sampled(MODEL, 0.05, 0.0)
    P = solve_discrete_are(A, B, w.Q, w.R, s=w.N)
    K = -np.linalg.solve(w.R + B.T @ P @ B, B.T @ P @ A + w.N.T)
    design = design_gains(MODEL, w, sample_time=0.05)
    np.testing.assert_allclose(design.K, K, rtol=1e-6, atol=1e-8 * np.abs(K).max())


@given(*[st.floats(0.1, 10.0)] * 6)
def test_every_axis_has_its_closed_form(q_p, q_v, r_tilt, q_yaw, r_yaw, r_thrust):
    g = 9.81
    design = design_gains(
        MODEL,
        weights(
            np.diag([q_p, q_p, q_p, q_v, q_v, q_v, q_yaw]),
            np.diag([r_tilt, r_tilt, r_yaw, r_thrust]),
        ),
    )
    tilt = math.sqrt(q_p / r_tilt)
    tilt_rate = math.sqrt(q_v / r_tilt + 2.0 * tilt / g)
    lift = math.sqrt(q_p / r_thrust)
    expected = np.zeros((4, 7))
    expected[0, [1, 4]] = tilt, tilt_rate
    expected[1, [0, 3]] = -tilt, -tilt_rate
    expected[2, 6] = -math.sqrt(q_yaw / r_yaw)
    expected[3, [2, 5]] = -lift, -math.sqrt(q_v / r_thrust + 2.0 * lift)
    np.testing.assert_allclose(design.K, expected, rtol=1e-6)


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.02, 0.033])
def test_a_sampled_plant_is_what_the_model_does(delay):
    model, sample_time = full_state(), 0.02
    rng = np.random.default_rng(4)
    A, B = sampled(model, sample_time, delay)
    steps = (A.shape[0] - model.x_dim) // model.u_dim
    x, new = rng.normal(size=model.x_dim), rng.normal(size=model.u_dim)
    past = rng.normal(size=(steps, model.u_dim))

    def acting(t):
        # Controls are sent at 0, -sample_time, ...; each acts `delay` later.
        sent = math.floor((t - delay) / sample_time + 1e-9)
        return new if sent >= 0 else past[-sent - 1]

    moments = [0.0, *([delay % sample_time] if delay % sample_time > 1e-9 else []), sample_time]
    state = x
    for begin, end in zip(moments, moments[1:], strict=False):
        u = acting((begin + end) / 2.0)
        flow = solve_ivp(
            lambda t, s, u=u: model.A @ s + model.B @ u, (begin, end), state, rtol=1e-10, atol=1e-12
        )
        state = flow.y[:, -1]
    step = A @ np.concatenate([x, past.ravel()]) + B @ new
    np.testing.assert_allclose(step[: model.x_dim], state, rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(
        step[model.x_dim :], np.vstack([new, past])[:steps].ravel() if steps else []
    )


@pytest.mark.parametrize(("delay", "allowed"), [(0.0, 1e-6), (0.01, 0.01), (0.035, 0.03)])
def test_gains_for_a_delay_cost_little_more_than_the_best(delay, allowed):
    w = weights()
    design = design_gains(MODEL, w, 0.01, delay)
    Q_all = np.zeros_like(design.A)
    Q_all[:7, :7] = w.Q

    def cost(entries):
        K = np.zeros((4, design.A.shape[0]))
        K[:, :7] = entries.reshape(4, 7)
        closed = design.A + design.B @ K
        if np.abs(np.linalg.eigvals(closed)).max() >= 1.0:
            return 1e9
        P = solve_discrete_lyapunov(closed.T, Q_all + K.T @ w.R @ K)
        return np.trace(P[:7, :7])

    used = np.flatnonzero(design.K)

    def cost_of_used(values):
        entries = np.zeros(28)
        entries[used] = values
        return cost(entries)

    best = minimize(cost_of_used, design.K.ravel()[used], method="BFGS").fun
    assert best > 0.0
    assert cost(design.K.ravel()) <= (1.0 + allowed) * best


def test_gains_that_ignore_the_delay_would_not_fly():
    K = design_gains(MODEL, weights(), 0.01).K
    A, B = sampled(MODEL, 0.01, 0.035)
    closed = A + B @ np.pad(K, ((0, 0), (0, A.shape[0] - 7)))
    assert np.abs(np.linalg.eigvals(closed)).max() > 1.0
    assert design_gains(MODEL, weights(), 0.01, 0.035).poles.real.max() < 0.0


@pytest.mark.parametrize("k", [1e-5, 2.0])
def test_a_control_of_no_effect_has_no_gain(k):
    integrator = LinearModel("yaw", ("yaw",), np.zeros((1, 1)), np.array([[0, 0, 1.0, 1e-12]]))
    design = design_gains(integrator, Weights(k**2 * np.eye(1), np.eye(4), np.zeros((1, 4))))
    np.testing.assert_allclose(design.K, [[0.0], [0.0], [-k], [0.0]], rtol=1e-9)


def test_poles_of_samples_are_continuous_ones():
    design = Design(np.zeros((4, 2)), np.diag([-0.5, -1e-5]), np.zeros((2, 4)), 0.1)
    # Half and turned about in 0.1 s; and gone.
    expected = [(-math.log(2.0) + 1j * math.pi) / 0.1, -math.inf]
    np.testing.assert_allclose(design.poles, expected)


def test_poles_of_a_fast_sampled_design_are_those_of_the_continuous_one():
    # The sum over the samples stands for the integral: weights are per sample.
    dt = 1e-4
    fast = design_gains(MODEL, weights(Q * dt, R * dt), sample_time=dt).poles
    slow = design_gains(MODEL, weights()).poles
    np.testing.assert_allclose(np.sort(fast.real), np.sort(slow.real), rtol=0.02)


def blind(direction):
    """Return a Q that costs nothing in one direction."""
    return np.eye(7) - np.outer(direction, direction) / np.dot(direction, direction)


def off_diagonal(value):
    q = Q.copy()
    q[1, 2] = value
    return q


def lift_and_z(value):
    n = NONE.copy()
    n[2, 3] = value
    return n


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (weights(q=-Q), "Q is not positive semidefinite"),
        (weights(q=off_diagonal(0.5)), r"Q is not symmetric: entry \(2, 3\) is 0\.5"),
        (weights(q=np.diag([math.nan] * 7)), "Q has entries that are not finite"),
        (weights(r=np.diag([1.0, 1.0, 1.0, 0.0])), "R is not positive definite"),
        (weights(r=np.diag([1.0, 1.0, 1.0, 1e-12])), "R is not positive definite"),
        (weights(r=-R), "R is not positive definite"),
        (weights(r=R + np.triu(R + 1.0, 1)), "R is not symmetric"),
        (weights(n=NONE + 1.0), "N is too large"),
        (weights(q=np.diag([0.0, 1, 1, 1, 1, 1, 1])), "do not see x,"),
        (weights(q=np.diag([1.0, 1, 1, 1, 1, 1, 0])), "do not see yaw,"),
        (weights(q=blind([0.7, 0.1, 0.705, 0, 0, 0, 0.03])), "do not see x, y, z, which"),
        # (2 z + u)^2: u = -2 z, by which it oscillates.
        (weights(np.diag([1, 1, 4, 1, 1, 0, 1]), np.eye(4), lift_and_z(2.0)), "see z, z_dot,"),
        (weights(q=1e30 * Q), "the Riccati equation has no stabilising solution"),
    ],
)
def test_bad_weights_are_refused_by_name(bad, message):
    with pytest.raises(DesignError, match=message):
        design_gains(MODEL, bad)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ((-0.01, 0.0), "sample time is -0.01 s"),
        ((math.nan, 0.0), "sample time is nan"),
        ((0.01, -0.1), "delay is -0.1 s"),
        ((0.01, math.inf), "delay is inf"),
        ((0.0, 0.1), "needs a sample time"),
        ((0.001, 1.0), "longer than 50 sample times"),
    ],
)
def test_bad_times_are_refused(times, message):
    with pytest.raises(DesignError, match=message):
        design_gains(MODEL, weights(), *times)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_unit_of_the_cost_changes_nothing(scale):
    def design(joint):
        x = MODEL.x_dim
        return design_gains(
            MODEL, Weights(*(scale * m for m in (joint[:x, :x], joint[x:, x:], joint[:x, x:])))
        )

    # Costs that vanish for some deviations, but for rounding.
    rng = np.random.default_rng(5)
    factor = rng.normal(size=(11, 9))
    assert design(factor @ factor.T).poles.real.max() < 0.0
    unseen = np.eye(11)
    unseen[:2, :2] -= np.outer([0.6, 0.8], [0.6, 0.8])
    free = np.diag([1.0] * 11)
    free[7:, 7:] = np.ones((4, 4))
    rewarded, coupled = np.eye(11), np.eye(11)
    rewarded[0, 0] = -1e-6
    coupled[2, 10] = coupled[10, 2] = 1.0 + 1e-6
    for joint, message in (
        (unseen, "do not see x, y,"),
        (free, "R is not positive definite"),
        (rewarded, "Q is not positive semidefinite"),
        (coupled, "N is too large"),
    ):
        with pytest.raises(DesignError, match=message):
            design(joint)


def test_weights_that_ask_for_more_than_the_delay_allows_are_refused():
    with pytest.raises(DesignError, match="the delay of 1 s allows; raise R or lower Q"):
        design_gains(MODEL, weights(q=1e6 * Q), 0.5, 1.0)


@pytest.mark.parametrize("pole", [0.0, 2.0])
def test_a_plant_that_no_control_reaches_is_refused(pole):
    A, B = MODEL.A.copy(), MODEL.B.copy()
    A[6, 6], B[6] = pole, 0.0
    stuck = LinearModel("stuck", MODEL.states, A, B)
    with pytest.raises(DesignError, match="stuck is not stabilisable: no control reaches yaw"):
        design_gains(stuck, weights())


def test_what_decays_by_itself_need_not_be_reached():
    A, B = MODEL.A.copy(), MODEL.B.copy()
    A[6, 6], B[6] = -2.0, 0.0
    damped = LinearModel("damped", MODEL.states, A, B)
    design = design_gains(damped, weights(q=np.diag([1.0] * 6 + [0.0])))
    np.testing.assert_array_equal(design.K[:, 6], np.zeros(4))
