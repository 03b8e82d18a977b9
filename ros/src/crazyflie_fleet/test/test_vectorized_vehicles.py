"""Many vehicles at once do what each does alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crazyflie_fleet.vectorized_simulator_node import batch_control
from crazyflie_fleet.vectorized_vehicles import VectorizedVehicles
from crazyflie_lqr.linear_feedback import IntegralStateFeedback
from crazyflie_model.dynamics import Coupled7D, NearHover
from crazyflie_simulator.vehicle import SimulatedVehicle

U_REF = np.array([0.0, 0.0, 0.0, 9.81])
K = np.array(
    [
        [0, 0.5, 0, 0, 0.6, 0, 0],
        [-0.5, 0, 0, -0.6, 0, 0, 0],
        [0, 0, 0, 0, 0, 0, -3.5],
        [0, 0, -6.0, 0, 0, -5.0, 0],
    ]
)
PLACES = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.5), (0.0, 1.0, 0.0)]
ANGLE = st.floats(-0.3, 0.3)
CONTROL = st.tuples(ANGLE, ANGLE, st.floats(-2.0, 2.0), st.floats(0.0, 16.0))
EVENT = st.one_of(st.tuples(st.integers(0, 2), CONTROL), st.sampled_from([0.004, 0.01, 0.2, 0.6]))


@pytest.mark.parametrize("dynamics", [NearHover(), Coupled7D()])
@given(events=st.lists(EVENT, max_size=8))
@settings(max_examples=15)
def test_vehicles(dynamics, events):
    batch = VectorizedVehicles(dynamics, PLACES, 5.0)
    alone = [SimulatedVehicle(dynamics, place, 5.0) for place in PLACES]
    time = 5.0
    for event in events:
        if isinstance(event, float):
            time += event
            batch.advance_to(time)
        else:
            batch.command(*event, time)
        for number, vehicle in enumerate(alone):
            vehicle.advance_to(time)
            if not isinstance(event, float) and event[0] == number:
                vehicle.command(event[1])
    batch.advance_to(time)
    assert batch.time == pytest.approx(alone[0].time)
    expected = [vehicle.state for vehicle in alone]
    assert batch.states == pytest.approx(np.array(expected), abs=1e-12)


def test_a_control_between_two_ticks_counts_from_its_time_on():
    batch = VectorizedVehicles(NearHover(), PLACES, 0.0)
    alone = SimulatedVehicle(NearHover(), PLACES[0], 0.0)
    for vehicle_time, u in ((0.013, (0.1, 0.0, 0.0, 12.0)), (0.027, (0.0, 0.2, 1.0, 9.0))):
        batch.command(0, u, vehicle_time)
        alone.advance_to(vehicle_time)
        alone.command(u)
        for now in (vehicle_time + 0.003, vehicle_time + 0.005):
            batch.advance_to(now)
            alone.advance_to(now)
    assert batch.states[0] == pytest.approx(alone.state, abs=1e-12)


def test_a_reset_of_the_clock():
    batch = VectorizedVehicles(NearHover(), PLACES, 10.0)
    alone = SimulatedVehicle(NearHover(), PLACES[1], 10.0)
    for part in (batch, alone):
        part.advance_to(10.5)
    batch.command(1, (0.1, 0.0, 0.0, 9.0), 10.5)
    alone.command((0.1, 0.0, 0.0, 9.0))
    for part in (batch, alone):
        part.advance_to(10.6)
        part.advance_to(2.0)
        part.advance_to(2.1)
    assert batch.time == pytest.approx(alone.time) == pytest.approx(2.1)
    assert batch.states[1] == pytest.approx(alone.state, abs=1e-12)


STATE = st.lists(st.floats(-5.0, 5.0), min_size=7, max_size=7)


@given(st.lists(st.tuples(STATE, STATE), min_size=1, max_size=4))
def test_controls(rows):
    x, x_ref = (np.array(part) for part in zip(*rows, strict=True))
    alone = [
        IntegralStateFeedback(K, U_REF, 6).control(*row, 0.0) for row in zip(x, x_ref, strict=True)
    ]
    assert batch_control(K, U_REF, x, x_ref) == pytest.approx(np.array(alone), abs=1e-9)


@pytest.mark.parametrize(("damping", "climbs"), [(K[3, 5], False), (-1.0, True)])
def test_a_controller_that_climbs_is_known(damping, climbs):
    gains = K.copy()
    gains[3, 5] = damping
    controller = IntegralStateFeedback(gains, U_REF, 6)
    assert controller.height_overshoots is climbs
    controller.take_off()
    x, x_ref = np.zeros((1, 7)), np.zeros((1, 7))
    x_ref[0, 2] = 1e-3
    together = batch_control(gains, U_REF, x, x_ref)[0]
    alone = controller.control(x[0], x_ref[0], 0.0)
    assert np.allclose(alone, together, rtol=0.0, atol=1e-12) is not climbs
