"""The PID controller against closed forms."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_controller.go_to import INTEGRATED_ERROR, PidParameters, SaturatedPid


def gains(kp, kd, ki, *limits):
    """Return parameters of a PID controller, in the order of their declaration."""
    names = ("min_output", "max_output", "integrator_min", "integrator_max")
    return PidParameters(kp=kp, kd=kd, ki=ki, **dict(zip(names, limits, strict=True)))


FREE = gains(40.0, 20.0, 2.0, -1e9, 1e9, -1e9, 1e9)

numbers = st.floats(-1e3, 1e3)
intervals = st.floats(0.0, 1.0)
updates = st.lists(st.tuples(numbers, numbers, intervals), min_size=1, max_size=20)


def test_an_error_that_grows_evenly():
    # For error = v t: output = kp v t + kd v + ki v t^2 / 2.
    pid, v, interval, steps = SaturatedPid(FREE), 0.03, 1e-3, 2000
    for step in range(1, steps + 1):
        output = pid.update(v * step * interval, v, interval)
    t = steps * interval
    assert output == pytest.approx(40.0 * v * t + 20.0 * v + 2.0 * v * t**2 / 2.0, rel=1e-3)


def test_only_a_part_of_a_large_error_is_integrated():
    pid = SaturatedPid(FREE)
    pid.update(5.0, 0.0, 1.0)
    assert pid.update(0.0, 0.0, 0.0) == pytest.approx(2.0 * INTEGRATED_ERROR)
    pid.update(-5.0, 0.0, 3.0)
    assert pid.update(0.0, 0.0, 0.0) == pytest.approx(-4.0 * INTEGRATED_ERROR)


def test_the_integral_does_not_wind_up():
    pid = SaturatedPid(gains(1.0, 0.0, 1.0, -10.0, 10.0, -0.1, 0.3))
    for _ in range(100):
        pid.update(0.2, 0.0, 1.0)
    assert pid.update(0.0, 0.0, 0.0) == pytest.approx(0.3)
    # It leaves the limit with the first error of the other sign.
    assert pid.update(-0.1, 0.0, 1.0) == pytest.approx(-0.1 + 0.2)
    for _ in range(100):
        pid.update(-0.2, 0.0, 1.0)
    assert pid.update(0.0, 0.0, 0.0) == pytest.approx(-0.1)


@given(output=st.floats(-1e6, 1e6), ki=st.floats(-1e4, 1e4).filter(lambda k: abs(k) > 1e-3))
def test_a_reset_gives_an_output_and_forgets_the_rest(output, ki):
    pid = SaturatedPid(gains(40.0, 20.0, ki, -1e7, 1e7, -1e12, 1e12))
    pid.update(3.0, 1.0, 0.5)
    pid.reset(output)
    assert pid.update(0.0, 0.0, 0.02) == pytest.approx(output, rel=1e-9, abs=1e-9)


def test_a_reset_without_an_integral_gain_leaves_nothing():
    pid = SaturatedPid(gains(-200.0, -20.0, 0.0, -200.0, 200.0, 0.0, 0.0))
    pid.reset(100.0)
    assert pid.update(0.0, 0.0, 1.0) == 0.0


def test_a_reset_keeps_to_the_limits_of_the_integral():
    pid = SaturatedPid(gains(40.0, 20.0, 2.0, -10.0, 10.0, -0.1, 0.1))
    pid.reset(5.0)
    assert pid.update(0.0, 0.0, 0.0) == pytest.approx(0.2)


@given(updates)
def test_the_output_keeps_to_its_limits(steps):
    pid = SaturatedPid(gains(-200.0, -20.0, 30.0, -10.0, 20.0, -0.5, 0.1))
    for step in steps:
        assert -10.0 <= pid.update(*step) <= 20.0


@given(updates)
def test_negative_gains_make_the_opposite(steps):
    pid = SaturatedPid(gains(40.0, 20.0, 2.0, -10.0, 10.0, -0.1, 0.1))
    negative = SaturatedPid(gains(-40.0, -20.0, -2.0, -10.0, 10.0, -0.1, 0.1))
    for step in steps:
        assert math.isclose(pid.update(*step), -negative.update(*step), abs_tol=1e-12)


def with_integral(parameters, integral):
    """Return a controller whose integral has a value."""
    pid = SaturatedPid(parameters)
    pid.reset(parameters.ki * integral)
    return pid


def test_other_gains_do_not_move_the_part_of_the_integral():
    pid = with_integral(gains(5000.0, 6000.0, 3500.0, 1e4, 6e4, -1e3, 1e3), 12.0)
    pid.parameters = gains(4000.0, 5000.0, 7000.0, 1e4, 6e4, -1e3, 1e3)
    assert pid.update(0.0, 0.0, 0.0) == pytest.approx(42000.0)


def test_other_limits_hold_at_once():
    pid = with_integral(gains(40.0, 20.0, 2.0, -10.0, 10.0, -0.1, 0.1), 0.1)
    pid.parameters = gains(40.0, 20.0, 2.0, -10.0, 10.0, -0.05, 0.05)
    assert pid.update(0.0, 0.0, 0.0) == pytest.approx(0.1)
    pid.parameters = gains(40.0, 20.0, 2.0, -0.01, 0.01, -0.05, 0.05)
    assert pid.update(0.0, 0.0, 0.0) == 0.01


def test_an_integral_gain_that_returns_begins_with_an_empty_integral():
    pid = with_integral(FREE, 1.0)
    pid.parameters = gains(40.0, 20.0, 0.0, -1e9, 1e9, -1e9, 1e9)
    pid.parameters = FREE
    assert pid.update(0.0, 0.0, 0.0) == 0.0
