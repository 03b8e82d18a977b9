"""When the acceleration is known from a control, and its value."""

import numpy as np
import pytest

from crazyflie_model.limits import HOLD_LIMIT
from crazyflie_model.units import GRAVITY
from crazyflie_state_estimator.control_response import ControlInput

HOVER = np.array([0.0, 0.0, 0.0, GRAVITY])


def test_nothing_is_known_without_a_control():
    assert ControlInput().acceleration(0.0, 1.0) is None


def test_a_control_is_known_until_it_is_old():
    control = ControlInput()
    control.command(np.array([0.0, 0.0, 0.0, GRAVITY + 1.0]), 10.0)
    for time in (10.0, 10.0 + HOLD_LIMIT):
        np.testing.assert_allclose(control.acceleration(0.0, time), [0.0, 0.0, 1.0])
    assert control.acceleration(0.0, 10.01 + HOLD_LIMIT) is None


def test_a_control_from_before_a_reset_of_time_is_not_used():
    control = ControlInput()
    control.command(HOVER, 10.0)
    assert control.acceleration(0.0, 1.0) is None


@pytest.mark.parametrize(
    ("thrust", "acceleration"), [(100.0, 16.0 - GRAVITY), (4.0, 4.0 - GRAVITY)]
)
def test_thrust_is_taken_for_no_more_than_a_vehicle_has(thrust, acceleration):
    control = ControlInput()
    control.command(np.array([0.0, 0.0, 0.0, thrust]), 0.0)
    assert control.acceleration(0.0, 0.0)[2] == pytest.approx(acceleration)


@pytest.mark.parametrize("thrust", [0.0, -5.0, 3.9])
def test_less_thrust_than_in_flight_is_not_used(thrust):
    control = ControlInput()
    control.command(np.array([0.1, 0.1, 0.0, thrust]), 0.0)
    assert control.acceleration(0.0, 0.0) is None


@pytest.mark.parametrize(
    ("yaw", "direction"), [(0.0, (1.0, 0.0)), (0.5 * np.pi, (0.0, 1.0)), (np.pi, (-1.0, 0.0))]
)
def test_it_points_where_the_vehicle_is_tilted_to_at_its_heading(yaw, direction):
    control = ControlInput()
    control.command(np.array([0.0, 0.1, 0.0, 10.0]), 0.0)
    x, y, _ = control.acceleration(yaw, 0.0)
    # 10 m/s^2 sin(0.1 rad), forward.
    assert (x, y) == pytest.approx([0.9983 * part for part in direction], abs=1e-3)
