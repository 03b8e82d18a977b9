"""A landing in closed loop: how fast the vehicle meets the ground."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from takeoff_helpers import PointMass, feedback

from crazyflie_takeoff.profiles import TakeoffPlan
from crazyflie_takeoff.server_table import FlightStateMachine, Request, ServerState

STIFF, SOFT = (20.0, 20.98), (1.5, 1.0)
"""Height gains of the simulation's and of the hardware's controller."""


def land(height, gains, speed=0.3, miscalibration=0.0):
    """Land from a hover; return the vehicle and how long it took, s.

    ``miscalibration`` is how much more thrust the vehicle gives than it is
    told, m/s^2; the hover begins in its equilibrium.
    """
    flight = FlightStateMachine(
        TakeoffPlan((0.0, 0.0, height), 1.0, 5.0, speed), ServerState.FLYING
    )
    vehicle = PointMass(height)
    reference = (height - miscalibration / gains[0], 0.0)
    flight.request(Request.LAND)
    for tick in range(6000):
        output = flight.tick(tick / 100, (0.0, 0.0, vehicle.z))
        if output.reference is not None:
            reference = (output.reference[2], output.reference[5])
        if output.thrust is not None:
            vehicle.command(output.thrust + miscalibration * (output.thrust > 0.0))
        elif flight.flight_state.in_flight:
            thrust = feedback(reference, vehicle.z, vehicle.z_dot, gains)
            vehicle.command(thrust + miscalibration)
        vehicle.advance(0.01)
        if flight.state is ServerState.ON_GROUND and vehicle.z == 0.0:
            return vehicle, tick / 100
    raise AssertionError("the landing did not end")


@given(st.floats(0.1, 3.0), st.sampled_from([STIFF, SOFT]), st.floats(0.1, 0.3))
def test_touches_down_below_half_a_metre_per_second(height, gains, speed):
    vehicle, duration = land(height, gains, speed)
    assert vehicle.z == 0.0
    assert 0.0 < vehicle.touchdown_speed < 0.5
    assert duration < height / speed + 3.0 + 1.0


@pytest.mark.parametrize("miscalibration", [-0.4, 0.4])
def test_touches_down_gently_with_a_thrust_that_is_off(miscalibration):
    vehicle, _ = land(1.0, STIFF, miscalibration=miscalibration)
    assert vehicle.z == 0.0
    assert 0.0 < vehicle.touchdown_speed < 0.5


def test_the_bare_ramp_is_a_fall():
    vehicle, _ = land(1.0, STIFF, speed=0.0)
    # z = 1 - 5/6 t^3 after the ramp's second, then free fall.
    fallen = (2.5**2 + 2.0 * 9.81 * (1.0 - 5.0 / 6.0)) ** 0.5
    assert vehicle.touchdown_speed == pytest.approx(fallen, abs=0.1)
