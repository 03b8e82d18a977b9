"""Controls that a filter passes on, by their sender; with a clock moved by hand."""

import math

import pytest
from filter_flight import G, level
from hypothesis import example, given
from hypothesis import strategies as st

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MAX_YAW_RATE, MIN_THRUST
from crazyflie_takeoff.envelope import (
    LANDING_CLIMB,
    NO_BOX,
    Box,
    Limits,
    Walls,
    cannot_climb_too_far,
    is_any_within_pause,
    within_climb,
    within_pause,
)
from crazyflie_takeoff.fallback import MAX_BRAKING, MAX_SUBSTITUTE, SafeSetpoint
from crazyflie_takeoff.guards import CLIMB_TIMEOUT
from crazyflie_takeoff.motion import Delay, Motion
from crazyflie_takeoff.publishers import Pauses, Publishers

ANY = st.floats(allow_nan=False, allow_infinity=False)


@given(ANY, ANY, ANY, ANY, st.sampled_from([0.0, MIN_THRUST]))
def test_any_control_ends_in_range(roll, pitch, yaw_dot, thrust, lowest):
    limits = Limits(NO_BOX, 0.5, -0.5, 3.0, 10.0)
    result = limits.in_range(SafeSetpoint(roll, pitch, yaw_dot, thrust), lowest)
    assert max(abs(result.roll), abs(result.pitch)) <= MAX_TILT
    assert abs(result.yaw_dot) <= MAX_YAW_RATE
    assert lowest <= result.thrust <= MAX_THRUST
    assert limits.in_range(result, lowest) == result


def test_a_model_may_have_closer_limits():
    limits = Limits(NO_BOX, 0.5, -0.5, 3.0, 10.0, 0.1, 1.0, 12.0)
    beyond = (
        SafeSetpoint(0.11, 0.0, 0.0, 10.0),
        SafeSetpoint(0.0, -0.11, 0.0, 10.0),
        SafeSetpoint(0.0, 0.0, 1.1, 10.0),
        level(12.1),
        level(3.9),
    )
    for control in beyond:
        assert not limits.contain(control)
        result = limits.in_range(control, MIN_THRUST)
        assert result != control
        assert limits.contain(result)


# Pauses.


def test_a_control_within_limits_is_passed_on_by_a_filter_that_runs():
    pauses = Pauses()
    control = SafeSetpoint(MAX_TILT, -MAX_TILT, 3.0, MAX_THRUST)
    for _ in range(1000):
        # As often as a filter runs that has little to do.
        pauses.note(0.04, 0.04)
        assert within_pause(control, pauses.longest, G) == control
        assert is_any_within_pause(pauses.longest)


@given(
    st.floats(0.01, 1.0),
    st.floats(-20.0, 20.0),
    st.floats(0.75 * G, 1.25 * G),
    st.floats(MIN_THRUST, MAX_THRUST),
)
@example(0.25, -3.0, G, 11.0)  # Within the pause the fall would end with 2 g,
@example(0.25, 3.0, G, 11.0)  # and the climb with less than no thrust.
def test_no_speed_is_ended_with_a_thrust_that_the_filter_does_not_give(pause, climb, hover, thrust):
    result = within_pause(level(thrust), pause, hover, climb).thrust
    assert MIN_THRUST <= result <= max(thrust, MAX_SUBSTITUTE)
    assert result >= min(thrust, hover - MAX_BRAKING)


@pytest.mark.parametrize(
    ("runs", "stops", "is_starved"),
    [(0.035, 0.315, True), (0.05, 0.3, True), (0.3, 0.2, False), (0.5, 0.4, False)],
)
def test_a_filter_that_hardly_runs_says_so(runs, stops, is_starved):
    pauses = Pauses()
    pauses.note(5.0, 5.0)
    assert pauses.complaint == ""
    for _ in range(20):
        for _ in range(round(runs / 0.01) - 1):
            pauses.note(0.01, 0.01)
        pauses.note(stops + 0.01, stops + 0.01)
    assert bool(pauses.complaint) == is_starved


@pytest.mark.parametrize(
    ("pause", "climb", "least", "most"),
    [
        # 0.5 m/s within the longest pause; after 0.2 s the present speed is included.
        (0.25, 0.0, -2.0, 2.0),
        (0.25, 0.25, -3.0, 1.0),
        (0.25, -0.25, -1.0, 3.0),
        (0.125, 0.0, -4.0, 4.0),
        (0.125, 0.25, -6.0, 4.0),
        (0.125, -0.25, -4.0, 6.0),
    ],
)
def test_how_much_thrust_a_filter_passes_on_that_has_not_run(pause, climb, least, most):
    assert not is_any_within_pause(pause)
    for asked, passed in ((-90.0, least), (0.5, 0.5), (90.0, most)):
        control = within_pause(SafeSetpoint(0.0, 0.0, 3.0, G + asked), pause, G, climb)
        assert control.thrust - G == pytest.approx(passed)
        assert control.yaw_dot == 3.0
    tilted = within_pause(SafeSetpoint(1.0, -1.0, 0.0, G), pause, G)
    assert math.tan(tilted.roll) == pytest.approx(0.5 / pause / G)
    assert tilted.pitch == -tilted.roll
    assert within_pause(level(-90.0), pause, G, climb, is_ramp=True).thrust == -90.0


def test_a_pause_is_forgotten_in_two_seconds():
    pauses = Pauses()
    pauses.note(8.0, 8.0)
    # A clock that steps further was set: 1 s is used.
    assert pauses.longest == 1.0
    pauses.note(0.5, 0.01)
    assert pauses.longest == pytest.approx(math.exp(-0.25))


# Climbs.


@pytest.mark.parametrize(
    ("z", "z_dot", "climb", "most"),
    [
        (0.0, 0.0, 3.0, 30.0),
        (0.0, 2.5, 3.0, 5.0),
        (0.0, 0.0, LANDING_CLIMB, 5.0),
        # With 4 m/s^2 a climb of 2 m/s ends within 0.5 m; above, it returns at 0.5/s.
        (9.5, 1.5, 3.0, 5.0),
        (11.0, 0.0, 3.0, -5.0),
        (10.0, 0.0, 3.0, 0.0),
        (10.0, 3.0, 3.0, 4.0 - G),
    ],
)
def test_the_most_thrust_of_a_climb(z, z_dot, climb, most):
    motion = Motion((0.0, 0.0, z), (0.0, 0.0, z_dot))
    thrust, excess = within_climb(99.0, G, motion, 10.0, climb)
    assert thrust - G == pytest.approx(most)
    assert excess
    assert within_climb(4.0, G, motion, 10.0, climb) == (4.0, "")
    assert within_climb(99.0, G, None, 10.0, climb) == (99.0, "")


@given(st.floats(0.0, 12.0), st.floats(-3.0, 4.0), st.floats(0.75 * G, 1.25 * G))
def test_where_no_climb_can_be_too_far_no_thrust_is_changed(z, z_dot, hover):
    motion = Motion((0.0, 0.0, z), (0.0, 0.0, z_dot))
    passed, _ = within_climb(MAX_THRUST, hover, motion, 10.0, 3.0)
    assert passed == MAX_THRUST or not cannot_climb_too_far(motion, 10.0, 3.0)


def climb(z, z_dot, seconds):
    """Fly full thrust for a while; return z, z_dot and what is said at last."""
    said = ""
    for _ in range(round(seconds * 100)):
        motion = Motion((0.0, 0.0, z), (0.0, 0.0, z_dot))
        thrust, said = within_climb(MAX_THRUST, G, motion, 10.0, 3.0)
        z_dot += 0.01 * (thrust - G)
        z += 0.01 * z_dot
    return z, z_dot, said


def test_a_climb_ends_at_its_speed_and_then_at_its_height():
    z, z_dot, said = climb(0.0, 0.0, 1.0)
    assert z_dot == pytest.approx(3.0, abs=0.01)
    assert said == "the controls climb faster than 3 m/s"
    z, z_dot, said = climb(z, z_dot, 5.0)
    assert (z, z_dot) == (pytest.approx(10.0, abs=0.2), pytest.approx(0.0, abs=0.1))
    assert said == "the controls climb beyond 10.00 m"


def test_a_step_of_three_metres_is_no_climb_to_complain_of():
    """The steepest that the shipped gains fly: 200 / s^2 and 28.28 / s (K_lqr.txt)."""
    z = z_dot = exceeds = 0.0
    for _ in range(500):
        thrust = min(max(G + 200.0 * (3.0 - z) - 28.28 * z_dot, MIN_THRUST), MAX_THRUST)
        motion = Motion((0.0, 0.0, z), (0.0, 0.0, z_dot))
        passed, said = within_climb(thrust, G, motion, 10.0, 3.0)
        exceeds = exceeds + 0.01 if said else 0.0
        assert exceeds < CLIMB_TIMEOUT
        z_dot += 0.01 * (passed - G)
        z += 0.01 * z_dot
    assert z == pytest.approx(3.0, abs=0.01)


def test_the_wall_above_counts_before_the_height():
    walls = Walls(Limits(Box((-1.0,) * 3, (1.0, 1.0, 2.0)), 0.5, -0.5, 3.0, 10.0))
    assert walls.highest(0.0) == 2.25
    walls.change(Box((-1.0,) * 3, (1.0, 1.0, 30.0)))
    assert walls.highest(0.5) == 10.5


# Publishers.


def test_a_rare_publisher_beside_a_busy_one_is_noticed():
    publishers = Publishers("controls", 3)
    for k in range(300):
        publishers.note(k / 100, "/busy")
        if k % 100 == 50:
            publishers.note(k / 100, "/rare")
    assert "/busy and /rare" in publishers.complaint


def test_one_after_the_other_are_not_two():
    publishers = Publishers("controls", 3)
    time = 0.0
    for name in "abcdefgh":
        for _ in range(10):
            publishers.note(time, f"/{name}")
            time += 0.01
        time += 0.6
    assert publishers.complaint == ""
    # Nor is a handover without a gap, or the clock set back.
    for k, name in enumerate(["/x", "/y", "/x", "/y", "/y"]):
        publishers.note(time + 0.01 * k, name)
    assert publishers.complaint == ""
    publishers.note(0.0, "/z")
    assert publishers.complaint == ""


# Delays.


def test_a_backlog_is_late_and_another_clock_is_not():
    delay = Delay()

    def excess(stamp, time):
        # The clock of the source is 1000 s behind.
        return delay.excess(stamp, 1000.0 + time, time)

    for k in range(100):
        assert excess(0.01 * k, 0.01 * k) == pytest.approx(0.0, abs=0.01)
    # 2 s in which nothing is delivered, and then all of it.
    assert excess(1.0, 3.0) == pytest.approx(1.8, abs=0.01)
    assert excess(2.0, 3.0) == pytest.approx(0.8, abs=0.01)
    assert excess(3.0, 3.0) == pytest.approx(0.0, abs=0.01)


def test_a_stamp_that_says_nothing_makes_nothing_late():
    delay = Delay()
    assert [delay.excess(0.0, time, time) for time in (1.0, 50.0)] == [0.0, 0.0]
    assert delay.excess(7.0, 8.0, 8.0) == 0.0
    assert delay.excess(7.0, 90.0, 90.0) == 0.0
