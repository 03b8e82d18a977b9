"""The PID controller against closed forms."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_controller.pid import INTEGRATED_ERROR, Gains, Pid

FREE = Gains(40.0, 20.0, 2.0, -1e9, 1e9, -1e9, 1e9)

numbers = st.floats(-1e3, 1e3)
intervals = st.floats(0.0, 1.0)
updates = st.lists(st.tuples(numbers, numbers, intervals), min_size=1, max_size=20)


def test_an_error_that_grows_evenly():
    # For error = v t: output = kp v t + kd v + ki v t^2 / 2.
    pid, v, interval, steps = Pid(FREE), 0.03, 1e-3, 2000
    for step in range(1, steps + 1):
        output = pid.update(v * step * interval, v, interval)
    t = steps * interval
    assert output == pytest.approx(40.0 * v * t + 20.0 * v + 2.0 * v * t**2 / 2.0, rel=1e-3)


def test_only_a_part_of_a_large_error_is_integrated():
    pid = Pid(FREE)
    pid.update(5.0, 0.0, 1.0)
    assert pid.update(0.0, 0.0, 0.0) == pytest.approx(2.0 * INTEGRATED_ERROR)
    pid.update(-5.0, 0.0, 3.0)
    assert pid.update(0.0, 0.0, 0.0) == pytest.approx(-4.0 * INTEGRATED_ERROR)


def test_the_integral_does_not_wind_up():
    pid = Pid(Gains(1.0, 0.0, 1.0, -10.0, 10.0, -0.1, 0.3))
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
    pid = Pid(Gains(40.0, 20.0, ki, -1e7, 1e7, -1e12, 1e12))
    pid.update(3.0, 1.0, 0.5)
    pid.reset(output)
    assert pid.update(0.0, 0.0, 0.02) == pytest.approx(output, rel=1e-9, abs=1e-9)


def test_a_reset_without_an_integral_gain_leaves_nothing():
    pid = Pid(Gains(-200.0, -20.0, 0.0, -200.0, 200.0, 0.0, 0.0))
    pid.reset(100.0)
    assert pid.update(0.0, 0.0, 1.0) == 0.0


def test_a_reset_keeps_to_the_limits_of_the_integral():
    pid = Pid(Gains(40.0, 20.0, 2.0, -10.0, 10.0, -0.1, 0.1))
    pid.reset(5.0)
    assert pid.update(0.0, 0.0, 0.0) == pytest.approx(0.2)


@given(updates)
def test_the_output_keeps_to_its_limits(steps):
    pid = Pid(Gains(-200.0, -20.0, 30.0, -10.0, 20.0, -0.5, 0.1))
    for step in steps:
        assert -10.0 <= pid.update(*step) <= 20.0


@given(updates)
def test_negative_gains_make_the_opposite(steps):
    pid = Pid(Gains(40.0, 20.0, 2.0, -10.0, 10.0, -0.1, 0.1))
    negative = Pid(Gains(-40.0, -20.0, -2.0, -10.0, 10.0, -0.1, 0.1))
    for step in steps:
        assert math.isclose(pid.update(*step), -negative.update(*step), abs_tol=1e-12)
