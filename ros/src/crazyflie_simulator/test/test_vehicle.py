"""A vehicle's time, its control's age, and that its flight can be repeated."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_model.dynamics import Coupled7D, NearHover
from crazyflie_model.stabilized_quadrotor import StabilizedQuadrotor
from crazyflie_model.units import GRAVITY
from crazyflie_simulator.vehicle import SimulatedVehicle
from crazyflie_simulator.wind import Wind

HOVER = np.array([0.0, 0.0, 0.0, GRAVITY])

MODELS = pytest.mark.parametrize(
    "make_dynamics",
    [
        NearHover,
        Coupled7D,
        lambda: StabilizedQuadrotor(wind=Wind((1.0, 0.0, 0.0), gust=0.5).velocity),
    ],
    ids=["near", "coupled", "quadrotor"],
)


@MODELS
def test_stays_put_until_the_first_control(make_dynamics):
    vehicle = SimulatedVehicle(make_dynamics(), [1.0, 2.0, 3.0], time=5.0)
    vehicle.advance_to(65.0)
    assert vehicle.pose == ((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))
    np.testing.assert_array_equal(vehicle.state[3:6], 0.0)
    assert vehicle.time == pytest.approx(65.0)


@MODELS
def test_ground_stops_the_fall_but_not_the_climb(make_dynamics):
    vehicle = SimulatedVehicle(make_dynamics(), [0.0, 0.0, 0.1], time=0.0)
    vehicle.command([0.0, 0.0, 0.0, 0.0])
    vehicle.advance_to(1.0)
    assert vehicle.state[2] == 0.0
    assert vehicle.state[5] == 0.0
    vehicle.command([0.0, 0.0, 0.0, GRAVITY + 2.0])
    vehicle.advance_to(1.4)
    assert vehicle.state[2] > 0.01


@MODELS
@pytest.mark.parametrize("delay", [0.0, 0.123])
@given(moments=st.lists(st.floats(0.0, 2.2), max_size=30), yaw_dot=st.sampled_from([0.0, 0.2]))
def test_how_often_it_is_asked_does_not_matter(make_dynamics, delay, moments, yaw_dot):
    def fly(moments):
        vehicle = SimulatedVehicle(make_dynamics(), [0.0, 0.0, 1.0], time=0.0, delay=delay)
        vehicle.command([0.05, -0.1, yaw_dot, 10.0])
        for moment in moments:
            vehicle.advance_to(moment)
        return vehicle.state

    # The control also becomes too old, for its tilt and for its thrust.
    np.testing.assert_array_equal(fly([2.2]), fly([*sorted(moments), 2.2]))


@MODELS
def test_the_same_controls_at_the_same_times_give_the_same_flight(make_dynamics):
    def fly():
        rng = np.random.default_rng(3)
        vehicle = SimulatedVehicle(make_dynamics(), [0.0, 0.0, 1.0], time=12.3)
        states = []
        for moment in 12.3 + np.cumsum(rng.uniform(0.001, 0.03, 100)):
            vehicle.advance_to(moment)
            vehicle.command(HOVER + rng.normal(0.0, 0.1, 4))
            states.append(vehicle.state)
        return states

    np.testing.assert_array_equal(fly(), fly())


def test_levels_out_and_stops_when_controls_stop():
    vehicle = SimulatedVehicle(NearHover(), [0.0, 0.0, 100.0], time=0.0)
    vehicle.command([0.1, 0.1, 0.3, GRAVITY])
    vehicle.advance_to(0.499)
    turning = vehicle.pose[1]
    vehicle.advance_to(0.5)
    moving = vehicle.state
    assert turning[0] > 0.0
    assert vehicle.pose[1][:2] == (0.0, 0.0)
    vehicle.advance_to(2.0)
    np.testing.assert_allclose(vehicle.state[3:], moving[3:], atol=1e-9)
    vehicle.advance_to(2.5)
    assert vehicle.state[5] == pytest.approx(-GRAVITY * 0.5)


@MODELS
def test_goes_on_when_the_clock_is_reset(make_dynamics):
    vehicle = SimulatedVehicle(make_dynamics(), [0.0, 0.0, 1.0], time=50.0)
    vehicle.command(HOVER)
    vehicle.advance_to(50.3)
    vehicle.advance_to(1.0)
    before = vehicle.state
    vehicle.advance_to(1.2)
    assert vehicle.time == pytest.approx(1.2)
    assert vehicle.state[2] == pytest.approx(before[2], abs=0.05)
    assert vehicle.state[2] > 0.9


def test_a_time_just_past_changes_nothing():
    vehicle = SimulatedVehicle(NearHover(), [0.0, 0.0, 1.0], time=0.0)
    vehicle.command([0.1, 0.0, 0.0, 11.0])
    vehicle.advance_to(0.1)
    state = vehicle.state
    vehicle.advance_to(0.0999)
    np.testing.assert_array_equal(vehicle.state, state)
    assert vehicle.time == pytest.approx(0.1)


def test_a_vehicle_that_has_tipped_over_stops_its_motors_until_it_is_told_otherwise():
    vehicle = SimulatedVehicle(NearHover(), [0.0, 0.0, 100.0], time=0.0, max_tilt=1.0)
    vehicle.command([0.9, 0.0, 0.0, GRAVITY])
    vehicle.advance_to(0.1)
    assert not vehicle.has_crashed
    vehicle.command([0.0, 1.1, 0.0, GRAVITY])
    vehicle.advance_to(0.2)
    vehicle.command(HOVER)
    vehicle.advance_to(1.2)
    assert vehicle.has_crashed
    assert vehicle.state[5] == pytest.approx(-1.1 * GRAVITY, rel=0.01)
    vehicle.recover()
    # Earlier commands are no longer valid.
    vehicle.advance_to(1.3)
    assert vehicle.state[5] == pytest.approx(-1.2 * GRAVITY, rel=0.01)
    falling = vehicle.state[5]
    vehicle.command(HOVER)
    vehicle.advance_to(1.4)
    assert vehicle.state[5] == pytest.approx(falling)


def test_what_is_skipped_has_not_happened():
    flown, skipped = (SimulatedVehicle(NearHover(), [0.0, 0.0, 100.0], time=0.0) for _ in range(2))
    for vehicle in (flown, skipped):
        vehicle.command([0.1, 0.1, 0.0, 11.0])
        vehicle.advance_to(0.2)
    skipped.skip(1e6)
    flown.advance_to(0.3)
    skipped.advance_to(1e6 + 0.3)
    np.testing.assert_array_equal(skipped.state, flown.state)
    assert skipped.time == pytest.approx(1e6 + 0.3)


def test_a_control_acts_after_the_delay():
    late, prompt = (SimulatedVehicle(NearHover(), (0, 0, 1), 0.0, delay=d) for d in (0.03, 0.0))
    late.command([0.0, 0.1, 0.0, 9.81])
    late.advance_to(0.030)
    assert late.state[:6] == pytest.approx([0, 0, 1, 0, 0, 0])
    late.command([0.0, 0.0, 0.0, 9.81])
    late.advance_to(0.130)
    prompt.command([0.0, 0.1, 0.0, 9.81])
    prompt.advance_to(0.030)
    prompt.command([0.0, 0.0, 0.0, 9.81])
    prompt.advance_to(0.100)
    assert prompt.state[3] > 0.01
    np.testing.assert_array_equal(late.state, prompt.state)
