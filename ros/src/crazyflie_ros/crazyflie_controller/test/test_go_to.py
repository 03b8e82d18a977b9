"""Which way the controller steers."""

import math

import pytest
from closed_loop import pids
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_controller.go_to import GoToController, Pose
from crazyflie_model.angles import rotate_by_yaw

HOVER = 42000.0
HERE = Pose(0.0, 0.0, 1.0, 0.0)


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
    assert steer(Pose(5.0, 5.0, 50.0, 2.0)) == (10.0, -10.0, 60000.0, -200.0)
    assert steer(Pose(-5.0, -5.0, -50.0, -2.0)) == (-10.0, 10.0, 10000.0, 200.0)


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
    Pose, st.floats(-2, 2), st.floats(-2, 2), st.floats(0, 2), st.floats(-math.pi, math.pi)
)


@given(st.lists(poses, min_size=2, max_size=5), poses, st.floats(-math.pi, math.pi))
def test_the_setpoint_does_not_depend_on_where_north_is(path, goal, turn):
    def turned(pose):
        return Pose(*rotate_by_yaw(pose.x, pose.y, turn), pose.z, pose.yaw + turn)

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
