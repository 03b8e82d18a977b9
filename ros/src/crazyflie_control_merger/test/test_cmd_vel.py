"""What the driver is told."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_control_merger.cmd_vel_converter_node import cmd_vel_from_control

values = st.floats(-10.0, 10.0)


def test_hover():
    assert cmd_vel_from_control(0.0, 0.0, 0.0, 9.81) == (
        (0.0, 0.0, pytest.approx(42000.0)),
        (0, 0, 0),
    )


def test_no_thrust_is_no_pwm():
    linear, _ = cmd_vel_from_control(0.0, 0.0, 0.0, 0.0)
    assert linear[2] == 0.0


def test_axes_and_signs():
    linear, angular = cmd_vel_from_control(0.1, 0.2, 0.5, 19.62)
    assert linear == pytest.approx((11.459156, 5.729578, 84000.0), rel=1e-6)
    assert angular == pytest.approx((0.0, 0.0, -28.647890), rel=1e-6)


@given(values, values, values, values)
def test_can_be_read_back(roll, pitch, yaw_dot, thrust):
    linear, angular = cmd_vel_from_control(roll, pitch, yaw_dot, thrust)
    assert linear[1] * math.pi / 180.0 == pytest.approx(roll)
    assert linear[0] * math.pi / 180.0 == pytest.approx(pitch)
    assert -angular[2] * math.pi / 180.0 == pytest.approx(yaw_dot)
    assert linear[2] * 9.81 / 42000.0 == pytest.approx(thrust)
