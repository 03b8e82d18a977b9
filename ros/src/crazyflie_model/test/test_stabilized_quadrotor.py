"""The full vehicle: hover, answers to steps, and a hover in closed loop."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_model.angles import zyx_from_quaternion
from crazyflie_model.dynamics import STEP
from crazyflie_model.elementwise import join, split
from crazyflie_model.stabilized_quadrotor import StabilizedQuadrotor
from crazyflie_model.units import GRAVITY

HOVER = np.array([0.0, 0.0, 0.0, GRAVITY])


class Vehicle:
    """One vehicle, step by step."""

    def __init__(self, height, **options):
        self._dynamics = StabilizedQuadrotor(**options)
        self._x = self._dynamics.initial_state((0.0, 0.0, height))
        self._steps = 0

    @property
    def state(self):
        return np.array(self._x)

    def fly(self, control, duration):
        """Fly with a constant control."""
        for _ in range(round(duration / STEP)):
            self._x = self._dynamics.step(self._steps, self._x, split(control))
            self._steps += 1


def answer(control, duration=3.0, **options):
    """Return the states, 100 a second, after a control is given to a vehicle in hover."""
    vehicle = Vehicle(100.0, **options)
    states = [vehicle.state]
    for _ in range(round(duration / 0.01) - 1):
        vehicle.fly(control, 0.01)
        states.append(vehicle.state)
    return np.array(states)


def attitudes(states):
    """Return roll, pitch, yaw in the heading frame, shape (n, 3)."""
    return np.array([zyx_from_quaternion(split(quaternion)) for quaternion in states[:, 6:10]])


def test_hover_is_an_equilibrium():
    states = answer(HOVER)
    np.testing.assert_allclose(states[-1], states[0], atol=1e-9)


@pytest.mark.parametrize("mass_error", [-0.1, 0.0, 0.1])
@pytest.mark.parametrize("thrust_error", [-0.1, 0.0, 0.1])
def test_hover_thrust_of_a_vehicle_that_is_not_nominal(mass_error, thrust_error):
    thrust = GRAVITY * (1.0 + mass_error) / (1.0 + thrust_error)
    # The rotors begin at the speed that carries the true vehicle.
    states = answer([0.0, 0.0, 0.0, thrust], 2.0, mass_error=mass_error, thrust_error=thrust_error)
    np.testing.assert_allclose(states[-1, :6], [0, 0, 100, 0, 0, 0], atol=1e-9)
    assert answer(HOVER, 0.5, mass_error=0.1)[-1, 5] < -0.2
    assert answer(HOVER, 0.5, thrust_error=0.1)[-1, 5] > 0.2


@pytest.mark.parametrize(("axis", "sideways"), [(0, (4, -1.0)), (1, (3, 1.0))])
def test_a_step_of_tilt_settles(axis, sideways):
    control = HOVER.copy()
    control[axis] = 0.2
    states = answer(control, 4.0)
    tilt = attitudes(states)[:, axis]
    assert tilt.max() < 0.2 * 1.35
    np.testing.assert_allclose(tilt[200:], 0.2, rtol=0.08)
    assert tilt[50] == pytest.approx(0.2, rel=0.35)
    others = np.delete(attitudes(states), axis, axis=1)
    np.testing.assert_allclose(others, 0.0, atol=0.02)
    column, sign = sideways
    assert sign * states[100, column] > 0.5


def test_a_step_of_yaw_rate_settles_and_is_held():
    states = answer([0.0, 0.0, 0.5, GRAVITY], 4.0)
    np.testing.assert_allclose(states[150:, 12], 0.5, rtol=0.1)
    # The heading is commanded, not only its rate: none is lost on the way.
    assert attitudes(states)[-1, 2] == pytest.approx(0.5 * 3.99, abs=0.1)
    np.testing.assert_allclose(states[-1, :3], [0.0, 0.0, 100.0], atol=0.1)


def test_tilt_is_in_the_heading_frame():
    vehicle = Vehicle(100.0)
    vehicle.fly([0, 0, 1.0, GRAVITY], np.pi / 2)
    vehicle.fly([0, 0.2, 0, GRAVITY], 1.0)
    # Nose to the left, nose down: it goes left.
    assert vehicle.state[4] > 1.0
    assert abs(vehicle.state[3]) < 0.3


def test_thrust_changes_as_fast_as_the_motors():
    states = answer([0.0, 0.0, 0.0, 12.0], 1.0)
    first, last = states[0, 13], states[-1, 13]
    assert last == pytest.approx(first * np.sqrt(12.0 / GRAVITY), rel=1e-3)
    risen = (states[6, 13] - first) / (last - first)
    assert risen == pytest.approx(1.0 - np.exp(-0.06 / 0.0647), abs=0.03)


def test_climbs_from_the_ground_whatever_tilt_is_asked_for_there():
    vehicle = Vehicle(0.0)
    vehicle.fly([0.2, -0.2, 0.5, 8.0], 2.0)
    np.testing.assert_array_equal(vehicle.state[:13], [0] * 9 + [1] + [0] * 3)
    assert vehicle.state[13] > 1000.0
    vehicle.fly([0.2, -0.2, 0.5, 12.0], 2.0)
    assert vehicle.state[2] > 0.5


@given(
    controls=st.lists(
        st.tuples(
            st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-6.0, 6.0), st.floats(0.0, 16.0)
        ),
        min_size=1,
        max_size=8,
    ),
    height=st.floats(0.0, 2.0),
)
def test_whatever_is_commanded_the_state_is_one(controls, height):
    vehicle = Vehicle(height, wind=lambda t: (np.sin(3.0 * t), np.cos(5.0 * t), np.sin(7.0 * t)))
    for control in controls:
        vehicle.fly(control, 0.05)
        assert np.isfinite(vehicle.state).all()
        assert np.linalg.norm(vehicle.state[6:10]) == pytest.approx(1.0, abs=1e-14)
        assert vehicle.state[2] >= 0.0
        assert (vehicle.state[13:17] >= 0.0).all()


def test_batches_fly_like_single_vehicles():
    dynamics = StabilizedQuadrotor(wind=lambda t: (1.0, 0.0, 0.0))
    rng = np.random.default_rng(8)
    positions = rng.uniform(0.0, 1.0, (4, 3))
    positions[0, 2] = 0.0
    controls = HOVER + rng.normal(size=(4, 4)) * [0.1, 0.1, 0.5, 1.0]
    controls[1, 3] = 0.0

    def fly(x, u):
        for count in range(100):
            x = dynamics.step(count, x, u)
        return join(x)

    singly = [
        fly(dynamics.initial_state(split(position)), split(control))
        for position, control in zip(positions, controls, strict=True)
    ]
    batch = fly(dynamics.initial_state(split(positions)), split(controls))
    np.testing.assert_allclose(batch, singly, rtol=1e-9, atol=1e-9)


def test_derivative_is_that_of_the_airframe_between_samples():
    dynamics = StabilizedQuadrotor(wind=lambda t: (1.0, 2.0, 0.0))
    x = dynamics.initial_state((0.0, 0.0, 1.0))
    x_dot = dynamics.derivative(0.0, x, HOVER)
    assert x_dot.shape == (dynamics.x_dim,)
    damping = 4.0 * 9.1785e-7 * dynamics.airframe.parameters.hover_speed / 0.027
    np.testing.assert_allclose(x_dot[3:6], [damping, 2.0 * damping, 0.0], atol=1e-12)
    np.testing.assert_array_equal(x_dot[17:], 0.0)


def test_its_pose_is_the_airframe_s():
    x = [float(each) for each in range(StabilizedQuadrotor.x_dim)]
    assert StabilizedQuadrotor().pose(x, split(HOVER)) == ((0.0, 1.0, 2.0), (6.0, 7.0, 8.0, 9.0))


@pytest.mark.parametrize(("count", "samples"), [(0, True), (1, False), (2, True), (3, False)])
def test_the_loops_sample_every_second_step(count, samples):
    dynamics = StabilizedQuadrotor()
    x = dynamics.initial_state((0.0, 0.0, 0.5))
    after = dynamics.step(count, x, [0.1, 0.0, 0.0, GRAVITY])
    assert (after[17:] != x[17:]) == samples


def test_on_the_ground_the_loops_are_reset_and_above_it_they_are_not():
    dynamics = StabilizedQuadrotor()
    control = [0.1, 0.2, 0.3, 4.0]
    standing = dynamics.step(0, dynamics.initial_state((0.0, 0.0, 0.0)), control)
    assert standing[17:26] == [0.0] * 9
    assert len(set(standing[26:])) == 1
    flying = dynamics.step(0, dynamics.initial_state((0.0, 0.0, 0.01)), control)
    # Integrals of the errors over 2 ms, and 2 ms of the yaw rate.
    assert flying[17:20] == pytest.approx([0.0002, 0.0004, 0.0006 * 0.002])
    assert flying[25] == pytest.approx(0.0006)
