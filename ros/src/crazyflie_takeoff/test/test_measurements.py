"""Measured states, the ground, the walls and the battery: figures on both sides of each bound."""

import math

import pytest
from filter_flight import at

from crazyflie_model.supervisor import SupervisorState
from crazyflie_takeoff.envelope import Box, Limits, Walls
from crazyflie_takeoff.motion import Delay, Ground, Measured
from crazyflie_takeoff.profiles import DESCENT_MARGIN, Descent
from crazyflie_takeoff.publishers import Publishers
from crazyflie_takeoff.refusals import BatteryCheck, Charge
from crazyflie_takeoff.vehicle_facts import VehicleFacts

# The state.


def test_a_state_is_fresh_for_a_fifth_of_a_second():
    measured = Measured()
    assert measured.within(0.0) is None
    assert measured.age(0.0) == math.inf
    measured.update(10.0, at(1.0), 0.125)
    assert measured.within(10.07) == at(1.0)
    assert measured.within(10.08) is None
    assert measured.within(10.08, 0.21) == at(1.0)
    assert measured.age(10.08) == pytest.approx(0.205)


def test_a_position_is_known_for_half_a_second():
    measured = Measured()
    assert measured.position(0.0) is None
    assert "no state has come on /state for 0.5 s" in measured.explanation(0.0, "/state")
    measured.update(10.0, at(3.0), 0.25)
    assert measured.position(10.125) == (0.0, 0.0, 3.0)
    assert measured.explanation(10.125, "/state") == ""
    assert measured.position(10.25) is None
    assert "states on /state get 0.5 s old before the next" in measured.explanation(10.25, "/state")
    assert "no state has come" in measured.explanation(10.5, "/state")
    # After a reset of the clock the age is measured from there.
    assert measured.position(2.0) == (0.0, 0.0, 3.0)
    assert measured.position(2.25) is None


def test_the_reason_is_the_longest_gap_of_the_last_seconds_or_the_age():
    measured = Measured()
    for time, age in [(10.0, 0.25), (10.875, 0.125), (11.0, 0.25)]:
        measured.update(time, at(3.0), age)
    explanation = measured.explanation(11.25, "/state")
    assert "states on /state get 1.1 s old before the next one comes; expected less" in explanation
    measured.update(17.0, at(3.0), 0.5)
    assert "states on /state are 0.5 s old when they come" in measured.explanation(17.0, "/state")


def test_a_state_that_is_older_than_the_known_one_does_not_replace_it():
    measured = Measured()
    measured.update(10.0, at(1.0), 0.0)
    measured.update(10.125, at(2.0), 3.0)
    assert measured.within(10.125) == at(1.0)
    measured.update(10.25, at(3.0), 0.25)
    assert measured.age(10.25) == 0.25
    assert measured.within(10.25, 0.3) == at(3.0)
    measured.update(13.0, at(4.0), 2.5)
    assert measured.within(13.0, 2.6) == at(4.0)
    measured.update(13.0, at(5.0), 0.0)
    assert measured.within(13.0) == at(5.0)


def test_the_usual_age_grows_by_a_tenth():
    delay = Delay()
    assert delay.excess(1.0, 1.5, 1.5) == 0.0
    # 10 s later 1 s more is usual.
    assert delay.excess(9.0, 11.5, 11.5) == pytest.approx(2.5 - 1.5)
    assert delay.excess(12.0, 12.5, 12.5) == 0.0
    # After a reset of the clock the usual age stays.
    assert delay.excess(1.0, 3.0, 3.0) == pytest.approx(1.5)


CLOCK_STEPS = [sign * step for step in (0.05, 0.2, 1.0, 30.0, 3600.0, 86400.0) for sign in (-1, 1)]


@pytest.mark.parametrize("step", CLOCK_STEPS)
@pytest.mark.parametrize("is_under_way", [True, False])
def test_messages_are_on_time_after_the_wall_clock_was_set(step, is_under_way):
    delay, wall = Delay(), 1.7e9
    for k in range(100):
        assert delay.excess(wall + 0.01 * k - 0.005, wall + 0.01 * k, 0.01 * k) == pytest.approx(
            0.0, abs=1e-6
        )
    stamp, wall = wall + 1.0 - 0.005, wall + step
    if is_under_way:
        assert delay.excess(stamp, wall + 1.0, 1.0) == 0.0
    for k in range(101, 300):
        excess = delay.excess(wall + 0.01 * k - 0.005, wall + 0.01 * k, 0.01 * k)
        # The age of a message that was stamped up to 0.05 s ahead is learned.
        assert excess < 0.051
    # One that is late now is noticed as before.
    assert delay.excess(wall + 3.0 - 0.605, wall + 3.0, 3.0) == pytest.approx(0.6, abs=0.06)


def test_a_source_whose_clock_is_ahead_is_late_when_it_is():
    delay = Delay()
    for k in range(100):
        assert delay.excess(0.01 * k + 0.15, 0.01 * k, 0.01 * k) == 0.0
    assert delay.excess(1.15 - 0.4, 1.0, 1.0) == pytest.approx(0.25, abs=0.002)


# The ground.


@pytest.mark.parametrize(
    ("z", "z_dot", "has_touched_down"),
    [(0.549, 0.0, True), (0.551, 0.0, False), (0.54, -0.099, True), (0.54, -0.101, False)],
)
def test_a_touchdown_is_low_and_slow(z, z_dot, has_touched_down):
    ground = Ground()
    assert ground.z == 0.0
    ground.z = 0.5
    assert ground.has_touched_down(at(z, z_dot)) == has_touched_down


def test_a_vehicle_less_than_10_cm_above_the_ground_is_on_it():
    ground = Ground()
    ground.z = 0.5
    assert [ground.is_below(at(z)) for z in (0.59, 0.61, 0.0)] == [True, False, True]
    assert ground.height(at(2.0)) == 1.5
    ground.z = 0.0
    assert not ground.is_below(at(0.1))
    assert not ground.has_touched_down(at(0.05))
    assert not ground.has_touched_down(at(0.0, -0.1))
    assert not ground.is_below(None)
    assert not ground.has_touched_down(None)


def test_a_single_measurement_does_not_show_that_a_vehicle_has_stopped_sinking():
    ground = Ground()
    assert not ground.sinks(at(1.0, -0.09))
    assert ground.sinks(at(1.0, -0.11))
    for _ in range(100):
        ground.advance(0.01, at(1.0, -0.3), 1.0)
    assert ground.sinks(at(1.0, 0.2))
    assert not ground.sinks(None)
    # ln(0.3 / 0.1) times the time constant of 0.5 s.
    sinking = 0
    while ground.sinks(at(1.0)):
        ground.advance(0.01, at(1.0), 1.0)
        sinking += 1
    assert sinking == pytest.approx(55, abs=1)
    ground.advance(0.01, at(1.0, -0.3), 1.0)
    ground.begin_descent()
    ground.advance(0.01, None, 1.0)
    assert not ground.sinks(at(1.0))


def test_what_has_flown_is_down_where_it_stays_without_enough_thrust():
    ground = Ground()
    ground.measure(at(0.75), is_on_ground=True, in_flight=False)
    assert ground.has_touched_down(at(0.75))
    ground.measure(at(0.8), is_on_ground=False, in_flight=False)
    assert ground.has_touched_down(at(0.75))
    ground.measure(at(0.86), is_on_ground=False, in_flight=False)
    # It may hover next to a table, at the table's height.
    assert not ground.has_touched_down(at(0.75))
    for thrust, speed in [(0.76, 0.0), (0.74, 0.1), (0.74, -0.1)]:
        for _ in range(100):
            ground.advance(0.01, at(0.0, speed), thrust)
        assert not ground.has_touched_down(at(0.0))
    touchdowns = []
    for _ in range(22):
        ground.advance(1 / 64, at(0.0), 0.74)
        touchdowns.append(ground.has_touched_down(at(0.0)))
    assert touchdowns == [False] * 19 + [True] * 3
    ground.advance(0.01, None, 0.74)
    assert not ground.has_touched_down(at(0.0))
    # The next takeoff is from there, and one that has the controller has flown, however low.
    ground.measure(at(0.0), is_on_ground=True, in_flight=False)
    ground.measure(at(0.03), is_on_ground=False, in_flight=True)
    assert not ground.has_touched_down(at(0.03))


# The driver.


def test_what_a_driver_says_counts_for_three_seconds():
    vehicle = VehicleFacts("/cf1/connected", str)
    assert vehicle.takeoff_refusal(0.0)
    vehicle.set_connected(1.0, True)
    assert [bool(vehicle.takeoff_refusal(now)) for now in (4.0, 4.1)] == [False, True]
    vehicle.set_connected(4.0, True)
    vehicle.set_status(1.0, SupervisorState.CRASHED, True, False)
    assert [bool(vehicle.takeoff_refusal(now)) for now in (4.0, 4.1)] == [True, False]


# The walls.

BOX = Box((-1.0, -2.0, 0.0), (1.0, 2.0, 3.0))
LIMITS = Limits(BOX, 0.5, -0.25, 3.0, 10.0)


@pytest.mark.parametrize(
    ("position", "excess"),
    [
        ((0.0, 0.0, 1.5), -1.0),
        ((0.75, 0.0, 1.5), -0.25),
        ((-1.5, 0.0, 1.5), 0.5),
        ((0.0, 2.25, 1.5), 0.25),
        ((1.25, -3.0, 4.0), 1.0),
        ((0.0, 0.0, -0.5), 0.5),
    ],
)
def test_how_far_outside_the_box_a_position_is(position, excess):
    assert BOX.excess(position) == excess


def test_a_box_without_a_floor():
    box = BOX.without_floor()
    assert box == Box((-1.0, -2.0, -math.inf), (1.0, 2.0, 3.0))


def test_what_is_too_far_outside_or_below():
    walls = Walls(LIMITS)
    assert walls.complaint((1.5, 0.0, 1.0)) == ""
    assert walls.complaint((1.75, 0.0, 1.0)) == "0.75 m outside the geofence"
    assert walls.complaint((0.0, 0.0, -0.25)) == ""
    assert walls.complaint((0.0, 0.0, -0.375)) == "0.38 m below the ground"


def test_a_vehicle_that_a_new_box_leaves_outside_may_come_back_and_not_go_away():
    walls = Walls(LIMITS)
    assert walls.complaint((1.0, 0.0, 1.0)) == ""
    walls.change(Box((-1.0, -2.0, 0.0), (0.0, 2.0, 3.0)))
    # 1 m outside was granted, and 0.5 m are always.
    assert walls.complaint((1.5, 0.0, 1.0)) == ""
    assert walls.complaint((1.75, 0.0, 1.0)) == "1.75 m outside the geofence"
    assert walls.complaint((0.25, 0.0, 1.0)) == ""
    # On the way back the grant shrinks.
    assert walls.complaint((0.75, 0.0, 1.0)) == ""
    assert walls.complaint((0.875, 0.0, 1.0)) == "0.88 m outside the geofence"
    inside = Walls(LIMITS)
    inside.change(Box((-0.5, -2.0, 0.0), (0.5, 2.0, 3.0)))
    assert inside.complaint((1.25, 0.0, 1.0)) == "0.75 m outside the geofence"


# The battery.


@pytest.mark.parametrize(
    ("voltage", "charge"),
    [(3.2, Charge.GOOD), (3.1, Charge.LOW), (3.0, Charge.LOW), (2.9, Charge.CRITICAL)],
)
def test_a_voltage_counts_when_it_has_lasted(voltage, charge):
    battery = BatteryCheck(3.2, 3.0, 2.0)
    assert math.isnan(battery.voltage)
    battery.measure(10.0, voltage)
    battery.measure(11.75, voltage)
    assert battery.charge(11.75) is Charge.GOOD
    # The 1.75 s without a voltage count as 1.5 s.
    battery.measure(11.875, voltage)
    assert battery.charge(11.875) is Charge.GOOD
    battery.measure(12.25, voltage)
    assert battery.charge(12.25) is charge
    assert battery.voltage == voltage
    # After a reset of the clock it goes on.
    assert battery.charge(1.0) is Charge.UNKNOWN
    battery.measure(1.0, voltage)
    assert battery.charge(1.0) is charge
    assert battery.charge(5.875) is charge
    assert battery.charge(6.0) is Charge.UNKNOWN
    battery.measure(6.0, 4.0)
    assert battery.charge(6.0) is Charge.GOOD


# Publishers.


def test_so_many_changes_as_tolerated_are_a_handover():
    publishers = Publishers("controls", 2)
    for k, name in enumerate("abab"):
        assert publishers.complaint == ""
        publishers.note(1.0 + 0.25 * k, name)
    assert publishers.complaint == "two nodes publish controls, a and b; expected one"
    # Half a second later it is not a second one; 5 s later it is forgotten.
    publishers.advance(6.25)
    assert publishers.complaint != ""
    publishers.advance(6.375)
    assert publishers.complaint == ""
    slow = Publishers("controls", 0)
    slow.note(1.0, "a")
    slow.note(1.5, "b")
    assert slow.complaint == ""
    slow.note(1.75, "")
    assert slow.complaint == "two nodes publish controls, b and one of this process; expected one"


def test_after_a_reset_of_the_clock_two_are_noticed_as_before():
    publishers = Publishers("controls", 0)
    publishers.note(90.0, "a")
    publishers.advance(1.0)
    publishers.note(1.25, "b")
    publishers.advance(1.25)
    assert publishers.complaint == "two nodes publish controls, a and b; expected one"


# The way down.


def test_a_descent_ends_at_its_ground():
    descent = Descent(10.0, (1.0, 2.0, 3.0), ground=1.0, speed=0.5)
    assert descent.reference(12.0) == (1.0, 2.0, 2.0, 0.0, 0.0, -0.5)
    assert not descent.is_over(14.0 + DESCENT_MARGIN)
    assert descent.is_over(14.1 + DESCENT_MARGIN)
