"""The simulated vehicle against closed forms and scipy's integrator."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crazyflie_simulator.dynamics import NearHover
from crazyflie_simulator.vehicle import Vehicle
from crazyflie_utils.units import GRAVITY

HOVER = np.array([0.0, 0.0, 0.0, GRAVITY])


def flown(control, duration, position=(0.0, 0.0, 1.0)):
    """Return the state after a constant control that is refreshed at 100 Hz."""
    vehicle = Vehicle(NearHover(), position, time=0.0)
    for moment in np.arange(0.0, duration, 0.01):
        vehicle.advance_to(moment)
        vehicle.command(control)
    vehicle.advance_to(duration)
    return vehicle.state


def test_constant_thrust_is_a_parabola():
    state = flown([0.0, 0.0, 0.0, GRAVITY + 2.0], 3.0)
    np.testing.assert_allclose(state, [0, 0, 1.0 + 0.5 * 2.0 * 3.0**2, 0, 0, 6.0, 0], atol=1e-9)


@pytest.mark.parametrize("control", [(0.1, 0.2, 0.5, 10.0), (-0.2, 0.05, -1.0, 9.9)])
def test_agrees_with_scipy(control):
    dynamics = NearHover()
    solution = solve_ivp(
        lambda t, x: dynamics.derivative(t, x, np.array(control)),
        (0.0, 2.0),
        dynamics.initial_state([0.0, 0.0, 1.0]),
        rtol=1e-10,
        atol=1e-12,
    )
    np.testing.assert_allclose(flown(control, 2.0), solution.y[:, -1], atol=1e-8)


def test_signs_of_roll_and_pitch():
    assert flown([0.1, 0.0, 0.0, GRAVITY], 0.5)[4] < 0.0
    assert flown([0.0, 0.1, 0.0, GRAVITY], 0.5)[3] > 0.0


def test_stays_put_until_the_first_control():
    vehicle = Vehicle(NearHover(), [1.0, 2.0, 3.0], time=5.0)
    vehicle.advance_to(65.0)
    np.testing.assert_array_equal(vehicle.state, [1, 2, 3, 0, 0, 0, 0])
    assert vehicle.time == pytest.approx(65.0)


def test_ground_stops_the_fall_but_not_the_climb():
    vehicle = Vehicle(NearHover(), [0.0, 0.0, 0.1], time=0.0)
    vehicle.command([0.0, 0.0, 0.0, 0.0])
    vehicle.advance_to(0.4)
    assert vehicle.state[2] == 0.0
    assert vehicle.state[5] == 0.0
    vehicle.command([0.0, 0.0, 0.0, GRAVITY + 1.0])
    vehicle.advance_to(0.6)
    assert vehicle.state[2] == pytest.approx(0.5 * 0.2**2)


def test_how_often_it_is_asked_does_not_matter():
    def fly(moments):
        vehicle = Vehicle(NearHover(), [0.0, 0.0, 1.0], time=0.0)
        vehicle.command([0.05, -0.1, 0.2, 10.0])
        for moment in moments:
            vehicle.advance_to(moment)
        return vehicle.state

    jittered = np.sort(np.random.default_rng(1).uniform(0.0, 0.4, 1000))
    np.testing.assert_array_equal(fly([0.4]), fly([*jittered, 0.4]))


def test_levels_out_and_stops_when_controls_stop():
    vehicle = Vehicle(NearHover(), [0.0, 0.0, 100.0], time=0.0)
    vehicle.command([0.1, 0.1, 0.3, GRAVITY])
    vehicle.advance_to(0.5)
    moving = vehicle.state.copy()
    vehicle.advance_to(2.0)
    np.testing.assert_allclose(vehicle.state[3:], moving[3:], atol=1e-9)
    vehicle.advance_to(2.5)
    assert vehicle.state[5] == pytest.approx(-GRAVITY * 0.5)


def test_goes_on_when_the_clock_is_reset():
    vehicle = Vehicle(NearHover(), [0.0, 0.0, 1.0], time=50.0)
    vehicle.command(HOVER)
    vehicle.advance_to(50.3)
    vehicle.advance_to(1.0)
    vehicle.advance_to(1.2)
    assert vehicle.time == pytest.approx(1.2)
    assert vehicle.state[2] == pytest.approx(1.0)


def test_batches_fly_like_single_vehicles():
    rng = np.random.default_rng(2)
    x, u = rng.normal(size=(5, 7)), rng.uniform(-0.3, 0.3, size=(5, 4))
    dynamics = NearHover()
    singly = np.array([dynamics.derivative(0.0, xi, ui) for xi, ui in zip(x, u, strict=True)])
    np.testing.assert_array_equal(dynamics.derivative(0.0, x, u), singly)
    grounded = np.array([dynamics.on_ground(xi) for xi in x])
    np.testing.assert_array_equal(dynamics.on_ground(x), grounded)
