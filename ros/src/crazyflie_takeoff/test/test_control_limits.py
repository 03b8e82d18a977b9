"""Controls that a filter passes on, by their sender; with a clock moved by hand."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MAX_YAW_RATE, MIN_THRUST
from crazyflie_takeoff.limits import (
    MEMORY,
    NO_BOX,
    Box,
    Callers,
    ClimbLimit,
    Limits,
    RunGaps,
    Walls,
)
from crazyflie_takeoff.motion import Delay, Motion
from crazyflie_takeoff.relay import Relay
from crazyflie_takeoff.safe_control import MAX_BRAKING, MAX_SUBSTITUTE, SafeSetpoint

G = 9.81
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
    relay = Relay(limits, 0.1)
    beyond = (
        SafeSetpoint(0.11, 0.0, 0.0, 10.0),
        SafeSetpoint(0.0, -0.11, 0.0, 10.0),
        SafeSetpoint(0.0, 0.0, 1.1, 10.0),
        SafeSetpoint(0.0, 0.0, 0.0, 12.1),
    )
    for control in beyond:
        assert not relay.pass_unchanged(0.0, control)
        result = limits.in_range(control, MIN_THRUST)
        assert result != control
        assert relay.pass_unchanged(0.0, result)


def test_a_control_within_limits_is_passed_on_by_a_filter_that_runs():
    gaps = RunGaps()
    control = SafeSetpoint(MAX_TILT, -MAX_TILT, 3.0, MAX_THRUST)
    for k in range(1000):
        # As often as a filter runs that has little to do.
        gaps.run(0.04 * k)
        assert gaps.apply(control, G) == control


@pytest.mark.parametrize("gap", [0.1, 0.3, 0.6])
def test_what_is_kept_for_long_changes_the_speed_by_half_a_metre_per_second(gap):
    gaps = RunGaps()
    gaps.run(1.0)
    gaps.run(1.0 + gap)
    high = gaps.apply(SafeSetpoint(MAX_TILT, 0.0, 0.0, MAX_THRUST), G)
    low = gaps.apply(SafeSetpoint(-MAX_TILT, 0.0, 0.0, MIN_THRUST), G)
    assert (high.thrust - G) * gap == pytest.approx(0.5)
    assert (low.thrust - G) * gap == pytest.approx(-0.5)
    assert G * math.tan(high.roll) * gap <= 0.5 + 1e-9
    # The ramp of a landing ends at zero thrust all the same.
    assert gaps.apply(SafeSetpoint(0.0, 0.0, 0.0, 0.0), G, is_ramp=True).thrust == 0.0
    for k in range(400):
        gaps.run(1.0 + gap + 0.01 * (k + 1))
    assert gaps.apply(SafeSetpoint(0.0, 0.0, 0.0, 14.0), G).thrust == 14.0


def test_speeds_do_not_add_up_over_long_gaps():
    gaps = RunGaps()
    gaps.run(1.0)
    gaps.run(1.3)
    assert gaps.apply(
        SafeSetpoint(0.0, 0.0, 0.0, MAX_THRUST), G, climb=0.4
    ).thrust == pytest.approx(G + 0.1 / 0.3)
    assert gaps.apply(SafeSetpoint(0.0, 0.0, 0.0, MAX_THRUST), G, climb=0.8).thrust < G
    assert gaps.apply(SafeSetpoint(0.0, 0.0, 0.0, MIN_THRUST), G, climb=-0.8).thrust > G


@given(
    st.floats(0.01, 1.0),
    st.floats(-20.0, 20.0),
    st.floats(0.75 * G, 1.25 * G),
    st.floats(MIN_THRUST, MAX_THRUST),
)
@example(0.25, -3.0, G, 11.0)  # Within the gap the fall would end with 2 g,
@example(0.25, 3.0, G, 11.0)  # and the climb with less than no thrust.
def test_no_speed_is_ended_with_a_thrust_that_the_filter_does_not_give(gap, climb, hover, thrust):
    gaps = RunGaps()
    gaps.run(1.0)
    gaps.run(1.0 + gap)
    result = gaps.apply(SafeSetpoint(0.0, 0.0, 0.0, thrust), hover, climb).thrust
    assert MIN_THRUST <= result <= max(thrust, MAX_SUBSTITUTE)
    assert result >= min(thrust, hover - MAX_BRAKING)


@pytest.mark.parametrize(
    ("runs", "stops", "is_starved"),
    [(0.035, 0.315, True), (0.05, 0.3, True), (0.3, 0.2, False), (0.5, 0.4, False)],
)
def test_a_filter_that_hardly_runs_says_so(runs, stops, is_starved):
    gaps, time = RunGaps(), 0.0
    for _ in range(20):
        for _ in range(round(runs / 0.01)):
            time += 0.01
            gaps.run(time)
        time += stops
    gaps.run(time)
    assert bool(gaps.complaint) == is_starved


def test_a_filter_that_was_stopped_once_does_not_say_so():
    gaps = RunGaps()
    for k in range(10):
        gaps.run(0.01 * k)
    gaps.run(5.0)
    assert gaps.complaint == ""


@pytest.mark.parametrize(
    ("gap", "climb", "least", "most"),
    [
        # 0.5 m/s within the longest gap; after 0.2 s the present speed is included.
        (0.25, 0.0, -2.0, 2.0),
        (0.25, 0.25, -3.0, 1.0),
        (0.25, -0.25, -1.0, 3.0),
        (0.125, 0.0, -4.0, 4.0),
        (0.125, 0.25, -6.0, 4.0),
        (0.125, -0.25, -4.0, 6.0),
    ],
)
def test_how_much_thrust_a_filter_passes_on_that_has_not_run(gap, climb, least, most):
    gaps = RunGaps()
    gaps.run(1.0)
    assert gaps.longest == 0.0
    gaps.run(1.0 + gap)
    assert gaps.longest == gap
    for asked, passed in ((-90.0, least), (0.5, 0.5), (90.0, most)):
        control = gaps.apply(SafeSetpoint(0.0, 0.0, 3.0, G + asked), G, climb)
        assert control.thrust - G == pytest.approx(passed)
        assert control.yaw_dot == 3.0
    tilted = gaps.apply(SafeSetpoint(1.0, -1.0, 0.0, G), G)
    assert math.tan(tilted.roll) == pytest.approx(0.5 / gap / G)
    assert tilted.pitch == -tilted.roll
    ramp = gaps.apply(SafeSetpoint(0.0, 0.0, 0.0, -90.0), G, climb, is_ramp=True)
    assert ramp.thrust == -90.0


def test_a_gap_is_forgotten_in_two_seconds():
    gaps = RunGaps()
    gaps.run(1.0)
    gaps.run(9.0)
    # A clock that steps further was set: 1 s is used.
    assert gaps.longest == 1.0
    gaps.run(9.0)
    gaps.run(8.0)
    gaps.run(8.5)
    assert gaps.longest == pytest.approx(math.exp(-0.25))


@pytest.mark.parametrize(
    ("z", "z_dot", "is_landing", "most"),
    [
        (0.0, 0.0, False, 30.0),
        (0.0, 2.5, False, 5.0),
        (0.0, 0.0, True, 5.0),
        # With 4 m/s^2 a climb of 2 m/s ends within 0.5 m; above, it returns at 0.5/s.
        (9.5, 1.5, False, 5.0),
        (11.0, 0.0, False, -5.0),
        (10.0, 0.0, False, 0.0),
        (10.0, 3.0, False, 4.0 - G),
    ],
)
def test_the_most_thrust_of_a_climb(z, z_dot, is_landing, most):
    motion = Motion((0.0, 0.0, z), (0.0, 0.0, z_dot))
    limit = ClimbLimit(3.0)
    assert limit.apply(99.0, G, motion, 10.0, is_landing) - G == pytest.approx(most)
    assert limit.apply(4.0, G, motion, 10.0, is_landing) == 4.0
    assert limit.apply(99.0, G, None, 10.0, is_landing) == 99.0


def test_too_much_climb_is_complained_of_after_two_seconds_but_not_in_a_landing():
    fast, landing = ClimbLimit(3.0), ClimbLimit(3.0)
    said = []
    for _ in range(9):
        motion = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 2.9))
        fast.apply(MAX_THRUST, G, motion, 10.0, False)
        landing.apply(MAX_THRUST, G, motion, 10.0, True)
        said.append((fast.advance(0.25), landing.advance(0.25)))
    assert said[:8] == [("", "")] * 8
    assert said[8] == ("the controls climb faster than 3 m/s", "")
    fast.apply(G, G, motion, 10.0, False)
    assert fast.advance(0.25) == ""


def climb(limit, z, z_dot, seconds, highest=10.0):
    """Fly full thrust for a while; return z, z_dot and what is said at last."""
    said = ""
    for _ in range(round(seconds * 100)):
        motion = Motion((0.0, 0.0, z), (0.0, 0.0, z_dot))
        thrust = limit.apply(MAX_THRUST, G, motion, highest, is_landing=False)
        said = limit.advance(0.01)
        z_dot += 0.01 * (thrust - G)
        z += 0.01 * z_dot
    return z, z_dot, said


def test_a_climb_ends_at_its_speed_and_then_at_its_height():
    limit = ClimbLimit(3.0)
    z, z_dot, said = climb(limit, 0.0, 0.0, 1.0)
    assert z_dot == pytest.approx(3.0, abs=0.01)
    assert said == ""
    z, z_dot, said = climb(limit, z, z_dot, 5.0)
    assert (z, z_dot) == (pytest.approx(10.0, abs=0.2), pytest.approx(0.0, abs=0.1))
    assert said == "the controls climb beyond 10.00 m"


def test_a_step_of_three_metres_is_no_climb_to_complain_of():
    """The steepest that the shipped gains fly: 200 / s^2 and 28.28 / s (K_lqr.txt)."""
    limit = ClimbLimit(3.0)
    z = z_dot = 0.0
    for _ in range(500):
        thrust = min(max(G + 200.0 * (3.0 - z) - 28.28 * z_dot, MIN_THRUST), MAX_THRUST)
        motion = Motion((0.0, 0.0, z), (0.0, 0.0, z_dot))
        passed = limit.apply(thrust, G, motion, 10.0, is_landing=False)
        assert limit.advance(0.01) == ""
        z_dot += 0.01 * (passed - G)
        z += 0.01 * z_dot
    assert z == pytest.approx(3.0, abs=0.01)


def test_the_wall_above_counts_before_the_height():
    walls = Walls(Limits(Box((-1.0,) * 3, (1.0, 1.0, 2.0)), 0.5, -0.5, 3.0, 10.0))
    assert walls.highest(0.0) == 2.25
    walls.change(Box((-1.0,) * 3, (1.0, 1.0, 30.0)))
    assert walls.highest(0.5) == 10.5


# Callers.


@pytest.mark.parametrize("period", [0.01, 0.1, 0.45])
def test_two_nodes_at_once_are_noticed_and_forgotten(period):
    callers = Callers("controls", 3)
    for k in range(10):
        callers.note(k * period, "/a")
        callers.note(k * period + 0.3 * period, "/b")
    assert callers.complaint == "two nodes publish controls, /a and /b; expected one"
    callers.advance(10 * period + MEMORY)
    assert callers.complaint == ""


def test_a_rare_publisher_beside_a_busy_one_is_noticed():
    callers = Callers("controls", 3)
    for k in range(300):
        callers.note(k / 100, "/busy")
        if k % 100 == 50:
            callers.note(k / 100, "/rare")
    assert "/busy and /rare" in callers.complaint


def test_one_after_the_other_are_not_two():
    callers = Callers("controls", 3)
    time = 0.0
    for name in "abcdefgh":
        for _ in range(10):
            callers.note(time, f"/{name}")
            time += 0.01
        time += 0.6
    assert callers.complaint == ""
    # Nor is a handover without a gap, or the clock set back.
    for k, name in enumerate(["/x", "/y", "/x", "/y", "/y"]):
        callers.note(time + 0.01 * k, name)
    assert callers.complaint == ""
    callers.note(0.0, "/z")
    assert callers.complaint == ""


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
