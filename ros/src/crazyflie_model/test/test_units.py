"""Thrust and PWM."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_model.units import pwm_from_thrust, thrust_from_pwm


def test_hover():
    assert pwm_from_thrust(9.81) == pytest.approx(42000.0)


def test_is_linear_through_zero():
    assert pwm_from_thrust(0.0) == 0.0
    assert pwm_from_thrust(4.905) == pytest.approx(21000.0)
    assert pwm_from_thrust(-9.81) == pytest.approx(-42000.0)


@given(st.floats(-1e3, 1e3))
def test_comes_back(thrust):
    assert thrust_from_pwm(pwm_from_thrust(thrust)) == pytest.approx(thrust)
