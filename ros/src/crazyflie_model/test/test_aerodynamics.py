"""Ground effect and downwash, against figures of their sources; what vehicles near others feel."""

import math

import pytest

from crazyflie_model.aerodynamics import Air, ground_effect, wake_speed
from crazyflie_model.quadrotor import CRAZYFLIE
from crazyflie_model.stabilized_quadrotor import Airframe
from crazyflie_model.units import GRAVITY

WEIGHT = CRAZYFLIE.mass * GRAVITY


def test_rotors_lift_more_near_the_ground():
    # A rotor one radius above the ground lifts a fifteenth more.
    assert ground_effect(0.023 - 0.02) == pytest.approx(16.0 / 15.0)
    assert 1.0 < ground_effect(0.5) < 1.0002
    assert ground_effect(0.0) == ground_effect(-1.0) < 1.1


def test_the_momentum_of_a_wake_is_the_thrust():
    # Of a jet with the profile of the source; its width is that of the jet here.
    below, step = 2.0, 0.001
    flow = sum(
        1.225 * wake_speed(below, r, WEIGHT) ** 2 * 2.0 * math.pi * r * step
        for r in (step * (k + 0.5) for k in range(3000))
    )
    assert flow == pytest.approx(WEIGHT, rel=0.15)


def test_a_wake_slows_down_and_widens_and_is_below():
    assert (
        wake_speed(0.2, 0.0, WEIGHT) == wake_speed(0.3, 0.0, WEIGHT) == pytest.approx(8.1, abs=0.1)
    )
    assert wake_speed(2.0, 0.0, WEIGHT) == pytest.approx(wake_speed(1.0, 0.0, WEIGHT) / 2.0)
    assert wake_speed(2.0, 0.188, WEIGHT) == pytest.approx(wake_speed(2.0, 0.0, WEIGHT) / 2.0)
    assert wake_speed(-0.5, 0.0, WEIGHT) == wake_speed(0.5, 0.0, 0.0) == 0.0


def test_a_vehicle_feels_the_wakes_of_those_above_it():
    air = Air()
    assert air.move("a", (0.9, 0.0, 1.5), WEIGHT) == 0.0
    alone = air.move("b", (1.1, 0.0, 1.0), WEIGHT)
    assert alone == wake_speed(0.5, 0.9 - 1.1, WEIGHT) > 0.0
    air.move("c", (1.1, -0.2, 1.5), WEIGHT)
    assert air.move("b", (1.1, 0.0, 1.0), WEIGHT) == pytest.approx(2.0 * alone)
    # Far away, and after the others have moved.
    assert air.move("b", (9.0, 0.0, 1.0), WEIGHT) == 0.0
    air.move("a", (9.0, 0.0, 1.4), WEIGHT)
    assert air.move("b", (9.0, 0.0, 1.0), WEIGHT) == pytest.approx(wake_speed(0.4, 0.0, WEIGHT))


def test_ground_effect_lifts_an_airframe_and_ends_above():
    plain, near = Airframe(CRAZYFLIE), Airframe(CRAZYFLIE, ground_effect)
    hover = [*[CRAZYFLIE.hover_speed] * 4, 0.0, 0.0, 0.0]
    climbs = {}
    for height in (0.02, 1.0):
        x = [*plain.initial_state((0.0, 0.0, height))]
        climbs[height] = near.rates(0.0, x, hover)[5] - plain.rates(0.0, x, hover)[5]
    assert climbs[0.02] == pytest.approx(GRAVITY * (ground_effect(0.02) - 1.0))
    assert 0.0 < climbs[1.0] < 0.001
