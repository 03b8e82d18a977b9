"""The PID controller, and four of them that fly to a goal."""

import math

import pytest
from closed_loop import pids
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_controller.go_to import (
    INTEGRATED_ERROR,
    GoToController,
    HeadingPose,
    PidParameters,
    SaturatedPid,
)
from crazyflie_model.angles import rotate_by_yaw


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


HOVER = 42000.0
HERE = HeadingPose(0.0, 0.0, 1.0, 0.0)


def steer(goal, pose=HERE):
    """Return the setpoint of a controller that has just begun."""
    controller = GoToController(pids())
    controller.reset(HOVER)
    return controller.update(pose, goal, 0.0)


def test_at_the_goal_it_hovers():
    assert steer(HERE) == (0.0, 0.0, pytest.approx(HOVER), 0.0)


def test_ahead_is_positive_pitch():
    assert steer(HERE._replace(x=0.1)) == (pytest.approx(4.0), 0.0, pytest.approx(HOVER), 0.0)


def test_to_the_left_is_negative_roll():
    assert steer(HERE._replace(y=0.1)) == (0.0, pytest.approx(-4.0), pytest.approx(HOVER), 0.0)


def test_above_is_more_thrust():
    assert steer(HERE._replace(z=1.1)).thrust == pytest.approx(HOVER + 500.0)


def test_counter_clockwise_is_a_negative_yaw_rate():
    assert steer(HERE._replace(yaw=0.1)).yaw_rate == pytest.approx(-20.0)


def test_everything_has_its_limit():
    assert steer(HeadingPose(5.0, 5.0, 50.0, 2.0)) == (10.0, -10.0, 60000.0, -200.0)
    assert steer(HeadingPose(-5.0, -5.0, -50.0, -2.0)) == (-10.0, 10.0, 10000.0, 200.0)


def test_turns_the_short_way():
    setpoint = steer(HERE._replace(yaw=-3.1), HERE._replace(yaw=3.1))
    assert setpoint.yaw_rate == pytest.approx(-200.0 * (2.0 * math.pi - 6.2))


def test_an_approach_at_the_right_speed_is_level():
    # The goal is 0.1 m ahead and comes nearer by 0.2 m/s: 40 * 0.1 - 20 * 0.2 = 0.
    controller = GoToController(pids())
    controller.reset(HOVER)
    goal = HERE._replace(x=1.0)
    controller.update(HERE._replace(x=0.898), goal, 0.0)
    setpoint = controller.update(HERE._replace(x=0.9), goal, 0.01)
    assert setpoint.pitch == pytest.approx(0.0, abs=0.01)


def test_turning_is_no_motion():
    controller = GoToController(pids())
    controller.reset(HOVER)
    goal = HERE._replace(x=0.1)
    controller.update(HERE, goal, 0.0)
    setpoint = controller.update(HERE._replace(yaw=0.5), goal, 0.01)
    assert setpoint.pitch == pytest.approx(40.0 * 0.1 * math.cos(0.5), abs=0.01)
    assert setpoint.roll == pytest.approx(40.0 * 0.1 * math.sin(0.5), abs=0.01)


def test_a_turn_through_the_seam_is_a_small_one():
    controller = GoToController(pids())
    controller.reset(HOVER)
    goal = HERE._replace(yaw=0.5)
    controller.update(HERE._replace(yaw=0.5 - math.pi + 0.001), goal, 0.0)
    setpoint = controller.update(HERE._replace(yaw=0.5 + math.pi - 0.001), goal, 0.01)
    # An error of nearly half a turn to the right, growing by 0.2 rad/s.
    assert setpoint.yaw_rate == 200.0
    assert GoToController(pids()).update(HERE, goal, 0.0).yaw_rate == pytest.approx(-100.0)


def test_a_forgotten_error_has_no_slope():
    controller = GoToController(pids())
    controller.reset(HOVER)
    controller.update(HERE, HERE, 0.0)
    controller.restart_derivatives()
    assert controller.update(HERE._replace(x=0.1), HERE, 0.0).pitch == pytest.approx(-4.0)


poses = st.builds(
    HeadingPose, st.floats(-2, 2), st.floats(-2, 2), st.floats(0, 2), st.floats(-math.pi, math.pi)
)


@given(st.lists(poses, min_size=2, max_size=5), poses, st.floats(-math.pi, math.pi))
def test_the_setpoint_does_not_depend_on_where_north_is(path, goal, turn):
    def turned(pose):
        return HeadingPose(*rotate_by_yaw(pose.x, pose.y, turn), pose.z, pose.yaw + turn)

    controllers = [GoToController(pids()) for _ in range(2)]

    def is_opposite(one, other):
        return abs(abs(math.remainder(one.yaw - other.yaw, 2.0 * math.pi)) - math.pi) < 1e-6

    for before, pose in zip([goal, *path], path, strict=False):
        # Exactly half a turn off, rounding decides which way to turn; and which way it has turned.
        if is_opposite(goal, pose) or is_opposite(before, pose):
            return
        one = controllers[0].update(pose, goal, 0.02)
        other = controllers[1].update(turned(pose), turned(goal), 0.02)
        assert other == pytest.approx(one, abs=1e-6)
