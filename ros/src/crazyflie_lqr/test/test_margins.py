"""Margins against closed forms, and against what happens beyond them."""

import math
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest

from crazyflie_lqr.design import Design, Weights, design_gains, sampled
from crazyflie_lqr.gain_file import load_matrix
from crazyflie_lqr.margins import flown, loop_margins, loop_response
from crazyflie_lqr.models import CONTROLS, full_state, near_hover

CONFIG = Path(__file__).parents[1] / "config"
MODEL = near_hover()
WEIGHTS = Weights(np.diag([1.0, 1, 4, 1, 1, 4, 100]), 0.01 * np.eye(4), np.zeros((7, 4)))
ALL = range(4)


def test_an_integrator_keeps_ninety_degrees():
    margins = loop_margins(design_gains(MODEL, WEIGHTS), CONTROLS.index("yaw_dot"))
    assert margins.phase == pytest.approx(math.pi / 2.0)
    assert margins.crossover == pytest.approx(100.0, rel=1e-4)
    assert margins.delay == pytest.approx(math.pi / 2.0 / 100.0, rel=1e-4)
    assert (margins.gain_up, margins.gain_down) == (math.inf, 0.0)


def test_a_double_integrator_has_its_closed_form():
    # L = (20.976 s + 20) / s^2 crosses 1 where w^4 = 20.976^2 w^2 + 20^2.
    margins = loop_margins(design_gains(MODEL, WEIGHTS), CONTROLS.index("thrust"))
    position, velocity = 20.0, math.sqrt(400.0 + 40.0)
    crossover = math.sqrt((velocity**2 + math.sqrt(velocity**4 + 4.0 * position**2)) / 2.0)
    assert margins.crossover == pytest.approx(crossover, rel=1e-4)
    assert margins.phase == pytest.approx(math.atan(velocity * crossover / position), rel=1e-4)


def test_slow_and_fast_loops_have_their_crossovers():
    slow = np.diag([1.0, 1, 4, 1, 1, 4, 1e-6])
    design = design_gains(MODEL, replace(WEIGHTS, Q=slow))
    yaw, thrust = (loop_margins(design, CONTROLS.index(name)) for name in ("yaw_dot", "thrust"))
    assert yaw.crossover == pytest.approx(0.01, rel=1e-4)
    assert thrust.crossover == pytest.approx(22.0, rel=0.1)


def loop_of(numerator, denominator):
    """Return a design with one control, whose loop is this strictly proper fraction in s."""
    A = np.eye(len(numerator), k=-1)
    A[0] = [-coefficient for coefficient in denominator[1:]]
    return Design(-np.array([numerator]), A, np.eye(len(numerator), 1), 0.0)


#: They have the gain 1 at four frequencies, and at two, the last time with a phase of 20 deg.
OFTEN = loop_of([6.0, 4.0, 8.0, 8.0, 0.0], [1.0, 0.0, 4.0, 4.0, -1.0, 1.0])
AHEAD = loop_of([5.0, 0.0, 0.0], [1.0, 10.4, 5.0, 10.0])


def test_a_loop_that_crosses_often_loses_its_worst_margin_first():
    def is_stable_with(factor):
        return np.linalg.eigvals(OFTEN.A + factor * OFTEN.B @ OFTEN.K).real.max() < 0.0

    margins = loop_margins(OFTEN, 0)
    for limit, inside in ((margins.gain_up, 0.99), (margins.gain_down, 1.01)):
        assert is_stable_with(inside * limit)
        assert not is_stable_with((2.0 - inside) * limit)
    assert margins.phase > 0.0
    assert is_stable_with(np.exp(0.99j * margins.phase))
    assert not is_stable_with(np.exp(1.01j * margins.phase))


@pytest.mark.parametrize(
    ("loop", "up", "down"),
    [
        # L = 2 / (s - 1): the plant is unstable, and half the gain does not hold it any more.
        (loop_of([2.0], [1.0, -1.0]), math.inf, 0.5),
        # L = -1 / (s + 3) is stable up to three times the gain.
        (loop_of([-1.0], [1.0, 3.0]), 3.0, 0.0),
        # L = 0.3 / (z - 1.1), z = 1 + s / 10.
        (replace(loop_of([0.3], [1.0, -1.1]), sample_time=0.1), 7.0, 1.0 / 3.0),
    ],
)
def test_a_loop_may_lose_or_gain_as_much_as_at_rest(loop, up, down):
    margins = loop_margins(loop, 0)
    assert (margins.gain_up, margins.gain_down) == pytest.approx((up, down))


@pytest.mark.parametrize("design", [OFTEN, AHEAD])
def test_a_continuous_loop_is_unstable_beyond_its_margin_of_delay(design):
    margin = loop_margins(design, 0).delay
    for excess, stable in ((0.99, True), (1.01, False)):
        delay = control.ss(control.tf(*control.pade(excess * margin, 8)))
        loop = control.ss(design.A, design.B, -design.K, 0.0) * delay
        assert (control.feedback(loop).poles().real.max() < 0.0) == stable


def test_a_sampled_integrator_has_its_closed_form():
    # z (z - 1) + k = 0, one sample late, is stable up to k = 1.
    design = design_gains(MODEL, WEIGHTS, 0.01, 0.01)
    loop = CONTROLS.index("yaw_dot")
    k = -design.K[loop, 6] * 0.01
    margins = loop_margins(design, loop)
    assert margins.gain_up == pytest.approx(1.0 / k, rel=1e-3)
    assert margins.gain_down == 0.0


def test_a_sampled_integrator_that_is_almost_unstable_may_grow_a_little():
    design = design_gains(MODEL, WEIGHTS, 0.01, 0.01)
    loop = CONTROLS.index("yaw_dot")
    near = loop_margins(replace(design, K=-95.0 / design.K[loop, 6] * design.K), loop)
    assert (near.gain_up, near.gain_down) == (pytest.approx(1.0 / 0.95, rel=1e-3), 0.0)


def test_response_of_a_sampled_loop_ends_below_half_the_sample_rate():
    frequency, _ = loop_response(design_gains(MODEL, WEIGHTS, 0.01, 0.01), 0)
    assert 0.9 * math.pi / 0.01 < frequency.max() < math.pi / 0.01


@pytest.mark.parametrize("seed", ALL)
@pytest.mark.parametrize("model", [near_hover(), full_state()])
def test_optimal_loops_keep_sixty_degrees_and_half_their_gain(model, seed):
    # Safonov and Athans, 1977, for a diagonal R.
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(model.x_dim, model.x_dim))
    weights = Weights(factor @ factor.T, np.diag(rng.uniform(0.1, 10.0, 4)), np.zeros_like(model.B))
    design = design_gains(model, weights)
    for loop in ALL:
        margins = loop_margins(design, loop)
        assert margins.phase >= math.pi / 3.0 - 1e-6
        assert margins.gain_up == math.inf
        assert margins.gain_down <= 0.5


def is_stable(design, factors):
    K = np.diag(factors) @ design.feedback
    return np.abs(np.linalg.eigvals(design.A + design.B @ K)).max() < 1.0


@pytest.mark.parametrize("loop", ALL)
@pytest.mark.parametrize("delay", [0.0, 0.013, 0.04])
def test_more_gain_than_the_margin_is_unstable(loop, delay):
    design = design_gains(MODEL, WEIGHTS, 0.01, delay)
    margins = loop_margins(design, loop)
    for excess, stable in ((0.995, True), (1.005, False)):
        factors = np.ones(4)
        factors[loop] = excess * margins.gain_up
        assert is_stable(design, factors) == stable


@pytest.mark.parametrize("loop", ALL)
def test_margins_of_a_loop_are_those_with_the_others_closed(loop):
    factor = np.random.default_rng(loop).normal(size=(7, 7))
    coupled = Weights(factor @ factor.T, 0.01 * np.eye(4), np.zeros((7, 4)))
    design = design_gains(MODEL, coupled, 0.01, 0.02)
    margins = loop_margins(design, loop)
    for limit, inside in ((margins.gain_up, 0.99), (margins.gain_down, 1.01)):
        for excess, stable in ((inside, True), (2.0 - inside, False)):
            factors = np.ones(4)
            factors[loop] = excess * limit
            assert limit == 0.0 or is_stable(design, factors) == stable


@pytest.mark.parametrize("delay", [0.0, 0.013, 0.04])
def test_more_delay_than_the_margin_is_unstable(delay):
    design = design_gains(MODEL, WEIGHTS, 0.01, delay)
    # Late by a fraction of a sample is not the same to a sampled loop as a lag
    # of its phase, but nearly so while the crossover is slow.
    margin = min(loop_margins(design, loop).delay for loop in ALL)
    for excess, stable in ((0.9, True), (1.1, False)):
        A, B = sampled(MODEL, 0.01, delay + excess * margin)
        assert is_stable(replace(design, A=A, B=B), np.ones(4)) == stable


def test_a_loop_without_gain_has_no_margins_to_lose():
    design = design_gains(MODEL, WEIGHTS)
    K = design.K.copy()
    K[2] = 0.0
    margins = loop_margins(replace(design, K=K, A=design.A - np.diag([0, 0, 0, 0, 0, 0, 1])), 2)
    assert (margins.gain_up, margins.phase, margins.delay) == (math.inf, math.inf, math.inf)
    assert margins.gain_down == 0.0
    assert math.isnan(margins.crossover)


def test_response_of_a_loop_is_that_of_its_transfer_function():
    frequency, response = loop_response(design_gains(MODEL, WEIGHTS), CONTROLS.index("pitch"))
    s = 1j * frequency
    velocity = math.sqrt(100.0 + 20.0 / 9.81)
    np.testing.assert_allclose(response, 9.81 * (velocity * s + 10.0) / s**2, rtol=1e-6)


@pytest.mark.parametrize("gain", [2.0, 8.0, 100.0])
def test_margins_of_an_integrator_whose_control_is_held_are_those_of_the_closed_form(gain):
    K = np.zeros((4, 7))
    K[2, 6] = -gain
    K[0, [1, 4]], K[1, [0, 3]], K[3, [2, 5]] = (2.5, 1.2), (-2.5, -1.2), (-6.0, -5.0)
    margins = loop_margins(flown(K, MODEL.states, MODEL, 0.01), CONTROLS.index("yaw_dot"))
    # L = k T / (z - 1): it is nearest to -1 at z = -1, and |L| = 1 at 2 sin(w T / 2) = k T.
    assert margins.modulus == pytest.approx(1.0 - gain * 0.01 / 2.0, rel=1e-3)
    half = math.asin(gain * 0.01 / 2.0)
    assert margins.delay == pytest.approx((math.pi / 2.0 - half) * 0.01 / (2.0 * half), rel=1e-3)


@pytest.mark.parametrize("plant", [near_hover(), full_state()], ids=lambda each: each.name)
def test_a_loop_as_it_is_flown_is_stable_up_to_its_delay(plant):
    K = load_matrix(str(CONFIG / "K_soft.txt"), 4, 7)
    delay = min(loop_margins(flown(K, MODEL.states, plant), each).delay for each in range(4))

    def is_stable(share):
        # All loops are late at once here; roll and pitch, the worst, do not act on each other.
        return flown(K, MODEL.states, plant, delay=share * delay).poles.real.max() < 0.0

    assert is_stable(0.98)
    assert not is_stable(1.02)


def test_a_loop_that_is_not_stable_bears_no_delay():
    K = load_matrix(str(CONFIG / "K_soft.txt"), 4, 7)
    margins = loop_margins(flown(-K, MODEL.states, MODEL), 0)
    assert (margins.delay, margins.modulus) == (0.0, 0.0)
