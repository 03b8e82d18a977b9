"""The vehicle with first-order lags."""

import dataclasses
import math

import pytest

from crazyflie_model.angles import rotate
from crazyflie_model.first_order_quadrotor import FirstOrderQuadrotor, lags
from crazyflie_model.quadrotor import CRAZYFLIE

MODEL = dataclasses.replace(CRAZYFLIE, roll_lag=0.05, pitch_lag=0.08, yaw_lag=0.1)


def flown(u, duration):
    dynamics = FirstOrderQuadrotor(MODEL)
    x = dynamics.initial_state([0.0, 0.0, 2.0])
    for count in range(round(1000.0 * duration)):
        x = dynamics.step(count, x, u)
    return x


def test_hovers_where_it_begins():
    assert flown([0.0, 0.0, 0.0, 9.81], 2.0)[:6] == pytest.approx([0, 0, 2, 0, 0, 0], abs=1e-9)


def test_each_axis_reaches_63_percent_after_its_lag():
    share = 1.0 - math.exp(-1.0)
    assert flown([0.1, 0.0, 0.0, 9.81], 0.05)[6] == pytest.approx(0.1 * share, rel=1e-6)
    assert flown([0.0, 0.1, 0.0, 9.81], 0.08)[7] == pytest.approx(0.1 * share, rel=1e-6)
    assert flown([0.0, 0.0, 1.0, 9.81], 0.1)[9] == pytest.approx(share, rel=1e-6)


def test_the_pose_is_tilted_to_where_it_accelerates():
    x = [0.0] * 6 + [0.1, 0.2, 2.0, 0.0, math.sqrt(9.81)]
    dynamics = FirstOrderQuadrotor(MODEL)
    acceleration = dynamics.rates(0.0, x, [0.0] * 4)[3:6]
    _, attitude = dynamics.pose(x, [0.0] * 4)
    up = rotate(attitude, (0.0, 0.0, 9.81))
    assert (up[0], up[1], up[2] - 9.81) == pytest.approx(acceleration, abs=0.02)


def test_drag_is_that_of_the_airframe_in_hover():
    x = flown([0.0, 0.05, 0.0, 9.81 / math.cos(0.05)], 60.0)
    # Acceleration by tilt and deceleration by drag are equal in the end.
    assert x[3] == pytest.approx(9.81 * math.tan(0.05) / MODEL.drag_rates[0], rel=1e-3)
    assert MODEL.drag_rates[0] == pytest.approx(
        MODEL.drag_horizontal * 4.0 * MODEL.hover_speed / MODEL.mass
    )


def test_it_stands_on_the_ground_without_thrust():
    x = flown([0.2, 0.0, 0.0, 0.0], 3.0)
    assert x[2] == 0.0
    assert x[3:8] == pytest.approx([0.0] * 5)


def test_without_lags_they_are_those_of_the_inner_loops():
    assert lags(CRAZYFLIE) == pytest.approx((1.0 / 6.0,) * 3)
