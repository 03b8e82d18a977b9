"""Following an object, and stopping before obstacles."""

import math
from dataclasses import replace

import pytest
from geometry_msgs.msg import Twist, Vector3
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import Range

from crazyflie_ranging.reaction_nodes import FollowObjectNode, ObstacleStopNode
from crazyflie_ranging.reactions import AXES, ObjectFollower, ObstacleStop
from crazyflie_references.velocity_reference import Velocity
from crazyflie_utils.testing import FakeProcess

COURSE = ObjectFollower(back_off=0.1, follow=0.3, lost=1.0, scale_linear=1.0, scale_angular=0.5)
STOP = ObstacleStop(distance=0.5, deceleration=0.5, reaction=0.3)


@pytest.mark.parametrize(
    ("front", "speed"),
    [
        (-math.inf, -1.0),
        (0.05, -1.0),
        (0.1, 0.0),
        (0.2, 0.0),
        (0.3, 0.0),
        (0.31, 1.0),
        (1.0, 1.0),
        (1.01, 0.0),
        (math.inf, 0.0),
    ],
)
def test_as_the_course_has_it(front, speed):
    assert COURSE.velocity(front) == (speed, 0.0)


@pytest.mark.parametrize(
    ("front", "left", "right", "yaw_dot"),
    [
        (math.inf, 0.8, math.inf, 0.5),
        (math.inf, math.inf, 0.8, -0.5),
        (math.inf, 0.8, 0.8, 0.0),
        (math.inf, None, 0.8, -0.5),
        (math.inf, None, None, 0.0),
        (0.5, 0.8, math.inf, 0.0),
    ],
)
def test_turns_to_one_side(front, left, right, yaw_dot):
    assert COURSE.velocity(front, left, right)[1] == yaw_dot


@pytest.fixture
def follower():
    process = FakeProcess()
    assert process.launch(FollowObjectNode(), "/follow_object")
    return process


def see(process, direction, reading):
    process.publish(f"/range/{direction}", Range(range=reading))


def commanded(process):
    twist = process.published("/cmd_vel")[-1]
    return twist.linear.x, twist.angular.z


def test_follows_and_backs_off(follower):
    for reading, speed in ((1.0, 0.3), (0.5, 0.0), (0.2, -0.3), (2.1, 0.0), (-math.inf, -0.3)):
        see(follower, "front", reading)
        follower.advance(0.02)
        assert commanded(follower) == (speed, 0.0)


@pytest.mark.parametrize("offset", [0.0, 0.005, 0.01, 0.019])
def test_stops_within_150_ms_of_the_last_reading(follower, offset):
    follower.advance(offset)
    see(follower, "front", 1.0)
    for _ in range(15):
        follower.advance(0.01)
    assert commanded(follower) == (0.0, 0.0)
    assert any(twist.linear.x > 0.0 for twist in follower.published("/cmd_vel"))
    assert "no message on /range/front" in follower.logged("warn")[-1]


def test_flies_on_with_readings_at_the_sensors_pace(follower):
    for _ in range(40):
        see(follower, "front", 1.0)
        follower.advance(0.05)
        assert commanded(follower) == (0.3, 0.0)


def test_what_is_no_number_is_silence(follower):
    for _ in range(20):
        see(follower, "front", math.nan)
        follower.advance(0.05)
    assert commanded(follower) == (0.0, 0.0)


def test_stands_still_at_the_end():
    process, node = FakeProcess(), FollowObjectNode()
    assert process.launch(node, "/follow_object")
    see(process, "front", 1.0)
    process.advance(0.02)
    process.shut_down({"/follow_object": node})
    assert commanded(process) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("distances/follow", 0.2, "are 0.3, 0.2 and 2; expected each >= the one before (m)"),
        ("distances/back_off", -1.0, "expected a finite number > 0 (m)"),
        ("time_step", 0.2, "time_step is 0.2; expected < silence, 0.15 (s)"),
    ],
)
def test_bad_parameters_are_named(name, value, expected):
    process = FakeProcess()
    assert not process.launch(FollowObjectNode(), "/follow_object", {name: value})
    assert expected in process.logged("error")[0]


# The obstacle stop.

SPEEDS = st.floats(-2.0, 2.0)
CLEARANCES = st.one_of(st.none(), st.floats(0.0, 5.0), st.just(math.inf))


@settings(deadline=None)
@given(st.sampled_from(sorted(AXES)), SPEEDS, CLEARANCES)
def test_nothing_leads_to_an_obstacle(direction, speed, clearance):
    axis, sign = AXES[direction]
    wanted = replace(Velocity(0.3, 0.3, 0.3, 0.7), **{axis: sign * speed})
    limited = STOP.limit(wanted, {direction: clearance})
    after = sign * getattr(limited, axis)
    assert replace(limited, **{axis: sign * speed}) == wanted
    if speed <= 0.0:
        assert after == speed
    elif clearance is None or clearance <= 0.5:
        assert after == 0.0
    elif math.isinf(clearance):
        assert after == speed
    else:
        # Reaction and braking end before it.
        assert 0.0 <= after <= speed
        assert after * 0.3 + after**2 / (2.0 * 0.5) <= clearance - 0.5 + 1e-9


def test_what_leads_away_or_is_far_off_stays():
    wanted = Velocity(-0.5, 0.3, 0.2, 1.0)
    far = dict.fromkeys(AXES, math.inf)
    assert STOP.limit(wanted, far) == wanted
    assert STOP.limit(wanted, {"front": 0.1, "right": None, "down": -math.inf}) == wanted
    assert STOP.limit(Velocity(0.3, 0.0, 0.0, 0.0), {"front": 1.5}).x == 0.3


@pytest.fixture
def stop():
    process = FakeProcess()
    assert process.launch(ObstacleStopNode(), "/obstacle_stop", {"directions": ["front", "left"]})
    return process


def command(process, x, y=0.0):
    process.publish("/cmd_vel_in", Twist(linear=Vector3(x=x, y=y), angular=Vector3(z=0.4)))


def test_passes_on_what_is_free(stop):
    see(stop, "front", 3.0)
    see(stop, "left", 0.2)
    command(stop, 0.4, 0.4)
    twist = stop.published("/cmd_vel")[-1]
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (0.4, 0.0, 0.4)
    command(stop, -0.4, -0.4)
    twist = stop.published("/cmd_vel")[-1]
    assert (twist.linear.x, twist.linear.y) == (-0.4, -0.4)


def test_an_obstacle_that_comes_between_two_commands(stop):
    see(stop, "front", 3.0)
    command(stop, 0.4)
    stop.advance(0.05)
    assert commanded(stop)[0] == 0.4
    see(stop, "front", 0.4)
    stop.advance(0.02)
    assert commanded(stop) == (0.0, 0.4)


@pytest.mark.parametrize("offset", [0.0, 0.01, 0.019])
def test_a_silent_sensor_stops_motion_there_within_150_ms(stop, offset):
    see(stop, "left", 3.0)
    command(stop, 0.4, 0.2)
    assert stop.published("/cmd_vel")[-1].linear.x == 0.0
    stop.advance(offset)
    see(stop, "front", 3.0)
    see(stop, "left", 3.0)
    command(stop, 0.4, 0.2)
    assert commanded(stop)[0] == 0.4
    for _ in range(3):
        stop.advance(0.05)
        see(stop, "left", 3.0)
    stop.advance(1e-6)
    twist = stop.published("/cmd_vel")[-1]
    assert (twist.linear.x, twist.linear.y) == (0.0, 0.2)
    assert "no motion to front: nothing comes below /range" in stop.logged("warn")[-1]


def test_stops_once_when_commands_end(stop):
    for _ in range(20):
        see(stop, "front", 3.0)
        stop.advance(0.05)
    assert stop.published("/cmd_vel") == []
    command(stop, 0.4)
    for _ in range(20):
        see(stop, "front", 3.0)
        stop.advance(0.05)
    said = [twist.linear.x for twist in stop.published("/cmd_vel")]
    assert said.count(0.0) == 1
    assert said[-1] == 0.0
    assert len(said) == pytest.approx(27, abs=1)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_command_that_is_not_finite_is_ignored(stop, bad):
    see(stop, "front", 3.0)
    command(stop, bad)
    assert stop.published("/cmd_vel") == []
    assert "/cmd_vel_in: it is not finite" in stop.logged("warn")[0]


def test_an_unknown_direction_is_named():
    process = FakeProcess()
    assert not process.launch(ObstacleStopNode(), "/obstacle_stop", {"directions": ["ahead"]})
    assert "one of front, back, left, right, up, down" in process.logged("error")[0]
