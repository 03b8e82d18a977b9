"""Flights of a simulated quadrotor in closed loop, from takeoff to touchdown."""

import numpy as np
import pytest
from closed_loop import PERIOD, Loop, control_from_cmd_vel

from crazyflie_control_merger.cmd_vel_converter_node import cmd_vel_from_control
from crazyflie_controller.flight import HOLD_LIMIT, OFF_AGE, State
from crazyflie_controller.go_to import GoToSetpoint, HeadingPose
from crazyflie_utils.refusal import RefusalError

OFF = GoToSetpoint()
VEHICLES = [
    {},
    {"mass_error": 0.05, "thrust_error": -0.05},
    {"mass_error": -0.05, "thrust_error": 0.05},
]


def standing(**options):
    loop = Loop(**options)
    loop.run(0.1)
    return loop


ABOVE = HeadingPose(0.0, 0.0, 1.0, 0.0)


def flying(goal=ABOVE, **options):
    loop = standing(**options)
    loop.flight.goal = goal
    loop.flight.take_off()
    loop.run_until(lambda: loop.flight.state is State.AUTOMATIC, 10.0)
    return loop


def contact_speed(track):
    """Return how fast, m/s, the vehicle sank in the tick before the last one above ground."""
    last = np.flatnonzero(track[:, 2] > 0.0)[-1]
    return (track[last - 1, 2] - track[last, 2]) / PERIOD


def test_these_are_the_signs_of_cmd_vel():
    control = [0.1, -0.2, 0.3, 9.0]
    linear, angular = cmd_vel_from_control(*control)
    assert control_from_cmd_vel(*linear, angular[2]) == pytest.approx(control)


def test_idle_is_without_thrust():
    loop = standing()
    assert set(loop.setpoints) == {OFF}
    assert loop.flight.state is State.IDLE


def test_a_takeoff_is_a_ramp():
    loop = standing()
    loop.flight.take_off()
    begin = len(loop.setpoints)
    loop.run(2.0)
    thrusts = [setpoint.thrust for setpoint in loop.setpoints[begin:]]
    np.testing.assert_allclose(np.diff(thrusts), 10000.0 * PERIOD)
    assert all(s._replace(thrust=0.0) == OFF for s in loop.setpoints)


@pytest.mark.parametrize("errors", VEHICLES)
@pytest.mark.parametrize("pose_period", [0.02, 1.0 / 30.0], ids=["50 Hz", "30 Hz"])
def test_flies_to_the_goal_and_lands_softly(errors, pose_period):
    goal = HeadingPose(0.6, -0.4, 1.0, 0.8)
    loop = flying(goal, pose_period=pose_period, **errors)
    assert 0.05 < loop.pose().z < 0.07
    track = loop.run(15.0)
    assert track[:, 2].max() < 1.5
    # The gains of Z leave a slow swing of the height.
    np.testing.assert_allclose(track[-100:, :2] - goal[:2], 0.0, atol=0.03)
    np.testing.assert_allclose(track[-100:, 2], goal.z, atol=0.12)
    np.testing.assert_allclose(track[-100:, 3], goal.yaw, atol=0.02)
    loop.run(10.0)
    loop.flight.land()
    track = loop.run_until(lambda: loop.flight.state is State.IDLE, 8.0)
    assert track[-1, 2] == 0.0
    assert contact_speed(track) < 0.5
    np.testing.assert_allclose(track[-1, :2] - goal[:2], 0.0, atol=0.05)
    assert loop.setpoints[-1] == OFF


def test_a_steep_descent_stays_near_the_straight_line():
    loop = flying(HeadingPose(0.0, 0.0, 3.0, 0.0))
    loop.run(20.0)
    loop.flight.goal = HeadingPose(0.3, 0.2, 0.6, 0.0)
    track = loop.run(5.0)
    assert track[:, 0].max() < 0.4
    assert track[:, 1].max() < 0.3


def test_turns_round_and_goes_on_the_spot():
    loop = flying()
    loop.run(8.0)
    loop.flight.goal = HeadingPose(1.0, 0.0, 1.0, -2.5)
    track = loop.run(6.0)
    # Its way turns into a curve, but not into a spiral.
    assert np.abs(track[:, 1]).max() < 0.3
    np.testing.assert_allclose(track[-50:, [0, 1, 3]], [[1.0, 0.0, -2.5]] * 50, atol=0.03)


def test_without_a_goal_it_hovers_above_the_start():
    loop = Loop()
    loop.put(0.5, 0.5)
    loop.run(0.1)
    loop.flight.take_off()
    loop.run(20.0)
    assert loop.run(1.0)[-1] == pytest.approx([0.5, 0.5, 0.5, 0.0], abs=0.05)


def test_a_hover_without_a_goal_is_no_goal_for_the_next_takeoff():
    loop = standing()
    loop.flight.take_off()
    loop.run(8.0)
    loop.flight.land()
    loop.run_until(lambda: loop.flight.state is State.IDLE, 8.0)
    loop.put(2.0, 0.0)
    loop.run(0.1)
    loop.flight.take_off()
    assert loop.run(8.0)[:, 0].min() > 1.9


def test_the_ground_is_where_it_starts():
    loop = flying(HeadingPose(0.0, 0.0, 1.5, 0.0), ground=0.7)
    loop.run(10.0)
    loop.flight.land()
    track = loop.run_until(lambda: loop.flight.state is State.IDLE, 8.0)
    assert track[0, 2] > 1.2
    assert track[-1, 2] == pytest.approx(0.7)


def in_state(state):
    loop = flying() if state in (State.AUTOMATIC, State.LANDING) else standing()
    if state in (State.TAKING_OFF, State.TOUCHING_DOWN):
        loop.flight.take_off()
        loop.run(0.5)
    if state is State.LANDING:
        loop.run(3.0)
    if state in (State.LANDING, State.TOUCHING_DOWN):
        loop.flight.land()
    return loop


@pytest.mark.parametrize("state", list(State))
def test_what_makes_no_sense_is_refused_and_changes_nothing(state):
    loop = in_state(state)
    assert loop.flight.state is state
    if state is not State.IDLE:
        with pytest.raises(RefusalError, match=state.value):
            loop.flight.take_off()
    if state in (State.IDLE, State.LANDING, State.TOUCHING_DOWN):
        with pytest.raises(RefusalError, match=state.value):
            loop.flight.land()
    assert loop.flight.state is state


def test_a_takeoff_can_be_broken_off():
    loop = standing()
    loop.flight.take_off()
    loop.run(2.0)
    loop.flight.land()
    track = loop.run_until(lambda: loop.flight.state is State.IDLE, 1.2)
    assert track[:, 2].max() == 0.0
    assert loop.setpoints[-1] == OFF


def test_a_vehicle_that_cannot_lift_off_is_not_pushed_for_ever():
    loop = standing(mass_error=0.5, thrust_error=-0.5)
    loop.flight.take_off()
    loop.run_until(lambda: loop.flight.state is State.IDLE, 6.5)
    assert "60000 PWM" in loop.flight.take_warning()
    assert loop.flight.take_warning() is None
    assert loop.setpoints[-1] == OFF


def test_no_takeoff_without_a_pose():
    loop = Loop()
    loop.is_seen = False
    loop.run(0.1)
    with pytest.raises(RefusalError, match="no new pose"):
        loop.flight.take_off()
    loop.is_seen = True
    loop.run(0.1)
    loop.is_seen = False
    loop.run(HOLD_LIMIT + 0.1)
    with pytest.raises(RefusalError, match="no new pose"):
        loop.flight.take_off()


def test_a_takeoff_without_a_new_pose_ends():
    loop = standing()
    loop.flight.take_off()
    loop.is_seen = False
    loop.run(HOLD_LIMIT + 0.1)
    assert loop.flight.state is State.IDLE
    assert loop.setpoints[-1] == OFF
    assert "takeoff ended" in loop.flight.take_warning()


def test_a_vehicle_without_poses_is_left_to_its_watchdog_until_they_come_again():
    loop = flying()
    loop.run(10.0)
    loop.is_seen = False
    begin = len(loop.setpoints)
    loop.run(HOLD_LIMIT + 0.2)
    silent = loop.setpoints[begin:]
    # The last setpoint is repeated, then no more come.
    ticks = round(HOLD_LIMIT / PERIOD)
    assert set(silent[: ticks - 1]) == {loop.setpoints[begin - 1]}
    assert set(silent[ticks + 1 :]) == {None}
    assert "sending no setpoints" in loop.flight.take_warning()
    loop.is_seen = True
    loop.run(12.0)
    assert loop.flight.state is State.AUTOMATIC
    assert loop.pose() == pytest.approx((0.0, 0.0, 1.0, 0.0), abs=0.15)


def test_a_flight_ends_when_the_vehicle_has_stopped_its_motors():
    loop = flying()
    loop.run(5.0)
    loop.is_seen = False
    loop.run(OFF_AGE + 0.1)
    assert loop.flight.state is State.IDLE
    # Seen again, it stays where it fell.
    loop.is_seen = True
    begin = len(loop.setpoints)
    loop.run(5.0)
    assert set(loop.setpoints[begin:]) == {OFF}
    assert loop.pose().z == 0.0


def test_lands_on_a_floor_that_is_higher_than_the_start():
    loop = flying()
    loop.run(10.0)
    loop.flight.land()
    # It stands on something 0.3 m high: seen there for ever.
    stuck = HeadingPose(0.0, 0.0, 0.3, 0.0)
    loop.pose = lambda: stuck
    loop.run_until(lambda: loop.flight.state is State.IDLE, 8.0)
    assert loop.setpoints[-1] == OFF


@pytest.mark.parametrize("moment", [0.0, 1.0, 6.0])
def test_a_landing_under_way_is_made_faster(moment):
    loop = flying(HeadingPose(0.0, 0.0, 5.0, 0.0))
    loop.run(20.0)
    assert loop.pose().z > 4.5
    loop.flight.land()
    loop.run(moment)
    loop.flight.land_within(7.0)
    track = loop.run_until(lambda: loop.flight.state is State.IDLE, 10.0)
    assert track[-1, 2] == 0.0
    assert contact_speed(track) < 1.0


def test_only_a_landing_is_made_faster():
    loop = flying()
    loop.run(5.0)
    loop.flight.land_within(7.0)
    loop.run(5.0)
    assert loop.flight.state is State.AUTOMATIC
    assert loop.pose().z == pytest.approx(1.0, abs=0.12)


def test_a_goal_during_a_landing_waits_for_the_next_takeoff():
    loop = flying()
    loop.run(5.0)
    loop.flight.land()
    loop.run(0.5)
    loop.flight.goal = HeadingPose(2.0, 0.0, 2.0, 0.0)
    track = loop.run_until(lambda: loop.flight.state is State.IDLE, 8.0)
    assert np.abs(track[:, 0]).max() < 0.05
    loop.flight.take_off()
    assert loop.run(12.0)[:, 0].max() > 1.9


def test_the_integrals_restart_with_every_flight():
    # Two flights in a row are the same.
    loop = flying()
    first = loop.run(3.0)
    loop.flight.land()
    loop.run_until(lambda: loop.flight.state is State.IDLE, 8.0)
    loop.run(1.0)
    loop.flight.take_off()
    loop.run_until(lambda: loop.flight.state is State.AUTOMATIC, 10.0)
    again = loop.run(3.0)
    np.testing.assert_allclose(again[:, 2], first[:, 2], atol=0.02)


@pytest.mark.parametrize("state", [State.TAKING_OFF, State.LANDING, State.TOUCHING_DOWN])
def test_goes_on_after_a_reset_of_the_clock(state):
    loop = in_state(state)
    loop.run(0.1 if state is State.TOUCHING_DOWN else 1.0)
    thrust = loop.setpoints[-1].thrust
    setpoint = loop.flight.tick(0.0, loop.time, loop.pose())
    assert setpoint.thrust == pytest.approx(thrust, rel=0.1)
    assert loop.flight.state is state
