"""The 7-dimensional models against closed forms and scipy's integrator."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_model.dynamics import (
    GROUND_FRICTION,
    STEP,
    Coupled7D,
    NearHover,
    coupled_acceleration,
    rk4_step,
)
from crazyflie_model.elementwise import join, split
from crazyflie_model.limits import MAX_TILT
from crazyflie_model.units import GRAVITY

MODELS = pytest.mark.parametrize("dynamics", [NearHover(), Coupled7D()], ids=["near", "coupled"])

TILTS = st.floats(-0.5, 0.5)
STATES = arrays(float, 7, elements=st.floats(-5.0, 5.0))
CONTROLS = st.tuples(TILTS, TILTS, st.floats(-3.0, 3.0), st.floats(0.0, 16.0))


def flown(dynamics, x, u, duration):
    """Return the state, as an array, a number of seconds later."""
    x, u = split(x), split(u)
    for count in range(round(duration / STEP)):
        x = dynamics.step(count, x, u)
    return join(x)


@MODELS
@pytest.mark.parametrize("control", [(0.1, 0.2, 0.5, 10.0), (-0.2, 0.05, -1.0, 9.9)])
def test_agrees_with_scipy(dynamics, control):
    start = np.array([0.3, -0.2, 5.0, 0.5, -1.0, 1.0, 0.7])
    solution = solve_ivp(
        lambda t, x: dynamics.derivative(t, x, control), (0.0, 2.0), start, rtol=1e-11, atol=1e-12
    )
    np.testing.assert_allclose(flown(dynamics, start, control, 2.0), solution.y[:, -1], atol=1e-9)


@MODELS
@given(thrust=st.floats(10.0, 16.0), yaw_dot=st.floats(-2.0, 2.0))
def test_thrust_alone_is_a_parabola(dynamics, thrust, yaw_dot):
    expected = [0, 0, 1.0 + 0.5 * (thrust - GRAVITY) * 0.25, 0, 0, 0.5 * (thrust - GRAVITY)]
    state = flown(dynamics, [0, 0, 1.0, 0, 0, 0, 0], [0, 0, yaw_dot, thrust], 0.5)
    np.testing.assert_allclose(state, [*expected, 0.5 * yaw_dot], atol=1e-12)


def test_near_hover_tilt_is_a_parabola_that_costs_no_lift():
    state = flown(NearHover(), [0, 0, 1, 0, 0, 0, 1.0], [0.1, 0.2, 0, GRAVITY], 1.0)
    ax, ay = GRAVITY * np.tan(0.2), -GRAVITY * np.tan(0.1)
    np.testing.assert_allclose(state, [ax / 2, ay / 2, 1, ax, ay, 0, 1.0], atol=1e-12)


def test_coupled_tilt_turns_with_the_heading():
    # Pitched forward while turning: the velocity goes round a circle.
    pitch, yaw_dot, thrust, t = 0.2, 1.5, GRAVITY / np.cos(0.2), 1.2
    state = flown(Coupled7D(), [0, 0, 1, 0, 0, 0, 0], [0, pitch, yaw_dot, thrust], t)
    speed = thrust * np.sin(pitch) / yaw_dot
    expected = [speed * np.sin(yaw_dot * t), speed * (1.0 - np.cos(yaw_dot * t)), 0.0]
    np.testing.assert_allclose(state[3:6], expected, atol=1e-9)
    assert state[6] == pytest.approx(yaw_dot * t)


def test_coupled_tilt_costs_lift():
    state = flown(Coupled7D(), [0, 0, 9, 0, 0, 0, 0], [0.3, -0.2, 0, GRAVITY], 1.0)
    assert state[5] == pytest.approx(GRAVITY * (np.cos(0.3) * np.cos(0.2) - 1.0))


@MODELS
def test_signs(dynamics):
    hover = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert flown(dynamics, hover, [0.1, 0, 0, GRAVITY], 0.5)[4] < 0.0
    assert flown(dynamics, hover, [0, 0.1, 0, GRAVITY], 0.5)[3] > 0.0
    assert flown(dynamics, hover, [0, 0, 0.1, GRAVITY], 0.5)[6] > 0.0


@given(x=STATES, u=CONTROLS)
def test_the_models_agree_about_hover(x, u):
    # To first order in tilt and yaw, about hover, they are one.
    small = 1e-5
    x = x * [1, 1, 1, 1, 1, 1, small]
    u = np.array(u) * [small, small, 1.0, 0.0] + [0, 0, 0, GRAVITY]
    np.testing.assert_allclose(
        NearHover().derivative(0.0, x, u), Coupled7D().derivative(0.0, x, u), atol=1e-7
    )


@MODELS
def test_batches_fly_like_single_vehicles(dynamics):
    rng = np.random.default_rng(2)
    x, u = rng.normal(size=(6, 7)), rng.uniform(-0.3, 0.3, size=(6, 4))
    # Below ground, both falling and climbing, and in the air.
    x[:, 2] = [-0.1, -0.1, 0.0, 0.0, 1.0, 1.0]
    x[:, 5] = [-1.0, 1.0] * 3
    singly = [dynamics.derivative(0.0, xi, ui) for xi, ui in zip(x, u, strict=True)]
    np.testing.assert_allclose(dynamics.derivative(0.0, x, u), singly, rtol=1e-14)
    stepped = [join(dynamics.step(0, split(xi), split(ui))) for xi, ui in zip(x, u, strict=True)]
    np.testing.assert_allclose(join(dynamics.step(0, split(x), split(u))), stepped, rtol=1e-14)


@MODELS
def test_derivative_takes_any_batch(dynamics):
    x, u = np.ones((2, 3, 7)), np.full(4, 0.1)
    assert dynamics.derivative(0.0, x, u).shape == (2, 3, 7)
    np.testing.assert_allclose(
        dynamics.derivative(0.0, x, u)[1, 2], dynamics.derivative(0.0, x[0, 0], u), rtol=1e-14
    )


@MODELS
@given(x=STATES, u=CONTROLS)
def test_never_below_ground(dynamics, x, u):
    state = flown(dynamics, x, u, 0.05)
    assert state[2] >= 0.0
    assert state[2] > 0.0 or state[5] >= 0.0


# On the ground it does not slide.


@MODELS
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_a_vehicle_that_lands_with_speed_stops_within_its_braking_distance(dynamics, heading):
    speed = 3.0
    velocity = speed * np.array([np.cos(heading), np.sin(heading), 0.0])
    start = [1.0, 2.0, 0.0, *velocity, 0.3]
    state = flown(dynamics, start, [0.0, 0.0, 0.0, 0.0], 1.0)
    way = speed**2 / (2.0 * GROUND_FRICTION * GRAVITY)
    np.testing.assert_allclose(state[:3], start[:3] + velocity / speed * way, atol=2e-3)
    np.testing.assert_array_equal(state[3:], [0.0, 0.0, 0.0, 0.3])


@MODELS
def test_thrust_takes_weight_off_the_ground(dynamics):
    start = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    state = flown(dynamics, start, [0.0, 0.0, 0.0, 0.6 * GRAVITY], 0.2)
    assert state[3] == pytest.approx(1.0 - 0.2 * GROUND_FRICTION * 0.4 * GRAVITY, abs=0.005)
    state = flown(dynamics, start, [0.0, 0.0, 0.0, GRAVITY], 0.2)
    assert state[3] == 1.0


@MODELS
@given(
    roll=st.floats(-MAX_TILT, MAX_TILT),
    pitch=st.floats(-MAX_TILT, MAX_TILT),
    thrust=st.floats(0.0, 2.0),
)
def test_a_tilt_that_is_commanded_on_the_ground_does_not_move_it(dynamics, roll, pitch, thrust):
    state = flown(dynamics, [0.0] * 7, [roll, pitch, 0.0, thrust], 0.1)
    np.testing.assert_allclose(state[:6], np.zeros(6), atol=1e-12)


@MODELS
def test_a_hard_landing_takes_speed_as_it_takes_the_fall(dynamics):
    state = flown(dynamics, [0.0, 0.0, 0.0005, 2.0, 0.0, -1.0, 0.0], [0.0, 0.0, 0.0, 0.0], STEP)
    assert state[3] == pytest.approx(2.0 - GROUND_FRICTION, abs=0.01)


@MODELS
@given(u=CONTROLS, yaw=st.floats(-3.0, 3.0))
def test_the_attitude_is_the_control_s_and_the_state_s(dynamics, u, yaw):
    position, quaternion = dynamics.pose([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, yaw], list(u))
    assert position == (1.0, 2.0, 3.0)
    assert rpy_from_quaternion(*quaternion) == pytest.approx((u[0], u[1], yaw), abs=1e-9)


@given(TILTS, st.floats(-3.0, 3.0), st.floats(4.0, 16.0))
def test_pitch_alone_is_a_rotation_of_the_thrust(pitch, yaw, thrust):
    thrust_axis = (Rotation.from_euler("z", yaw) * Rotation.from_euler("y", pitch)).apply([0, 0, 1])
    np.testing.assert_allclose(
        coupled_acceleration((0.0, pitch, 0.0, thrust), yaw),
        thrust * thrust_axis - [0.0, 0.0, GRAVITY],
        atol=1e-12,
    )


@given(TILTS, st.floats(-3.0, 3.0), st.floats(4.0, 16.0))
def test_roll_alone_is_a_rotation_of_the_thrust(roll, yaw, thrust):
    thrust_axis = (Rotation.from_euler("z", yaw) * Rotation.from_euler("x", roll)).apply([0, 0, 1])
    np.testing.assert_allclose(
        coupled_acceleration((roll, 0.0, 0.0, thrust), yaw),
        thrust * thrust_axis - [0.0, 0.0, GRAVITY],
        atol=1e-12,
    )


@MODELS
def test_it_begins_at_rest(dynamics):
    assert dynamics.initial_state((1.0, 2.0, 3.0)) == [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0]


def test_rates_that_depend_on_the_time_are_integrated_as_by_simpson_s_rule():
    # It is exact for a cubic.
    (x,) = rk4_step(lambda t, x, u: [u[0] * t**3], 1.0, [7.0], [2.0], 0.5)
    assert x == pytest.approx(7.0 + 2.0 * (1.5**4 - 1.0) / 4.0)


class Drag(Coupled7D):
    """A model that is derived from `Coupled7D`."""

    def rates(self, t, x, u):
        rates = super().rates(t, x, u)
        return [*rates[:3], rates[3] - 0.5 * x[3], *rates[4:]]


def test_a_derived_model_flies_by_its_own_rates():
    x = [0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0]
    for count in range(1000):
        x = Drag().step(count, x, [0.0, 0.0, 0.0, GRAVITY])
    assert x[3] == pytest.approx(2.0 * math.exp(-0.5), rel=1e-6)


class Ceiling(NearHover):
    """A model of which only the contact is its own."""

    def apply_ground_contact(self, x):
        return [*x[:2], min(x[2], 1.0), *x[3:]]


class Sinking(Coupled7D):
    """A model with steps of its own."""

    def step(self, count, x, u):
        return [*x[:2], x[2] - 1e-3 * count, *x[3:]]


@pytest.mark.parametrize("model", [NearHover, Coupled7D, Drag, Ceiling, Sinking])
@pytest.mark.parametrize("z", [0.005, 0.999])
@pytest.mark.parametrize("yaw_dot", [0.0, 0.7])
def test_many_steps_are_those_of_one_after_another(model, z, yaw_dot):
    u, start = [0.1, -0.05, yaw_dot, GRAVITY - 2.0 + 3.0 * z], [0.0, 0.0, z, 1.0, -0.5, -0.1, 0.3]
    for together in (200, 40):
        x = single = start
        for begin in range(5, 205, together):
            x = model().steps(together, begin, x, u)
            for count in range(begin, begin + together):
                single = model().step(count, single, u)
        # A formula has other rounding errors.
        is_exact = model().has_exact_steps
        assert x == (pytest.approx(single, rel=1e-12, abs=1e-12) if is_exact else single)


def test_vehicles_that_do_not_turn_fly_as_those_next_to_one_that_does():
    u = [[0.1, 0.1], [-0.05, -0.05], [0.0, 0.7], [9.5, 9.5]]
    x = [np.array([value, value]) for value in (0.0, 0.0, 0.3, 1.0, -0.5, -0.1, 0.3)]
    both = Coupled7D().steps(300, 0, x, [np.array(each) for each in u])
    alone = Coupled7D().steps(300, 0, [each[:1] for each in x], [np.array(each[:1]) for each in u])
    np.testing.assert_allclose([each[0] for each in both], np.ravel(alone), rtol=0, atol=1e-12)
