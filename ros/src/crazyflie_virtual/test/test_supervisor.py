"""The supervisor's states, with sensors and clock moved by hand; more in test_recorded_*.py."""

from types import SimpleNamespace

import pytest

from crazyflie_model.supervisor import SupervisorState
from crazyflie_virtual.firmware.states import DISABLED, VELOCITY, Modes, Setpoint
from crazyflie_virtual.firmware.supervisor import TRANSITIONS, State, Supervisor

PERIOD = 0.04


class Hand:
    """A supervisor, and the hand that feeds it."""

    def __init__(self, auto_arm=True):
        self.said = []
        self.supervisor = Supervisor(self.said.append, auto_arm)
        self.time = 0.0
        self.force = (0.0, 0.0, 1.0)
        self.setpoint_age = 0.0
        self.motors_run = False

    def run(self, duration):
        """Advance the time; return the state."""
        for _ in range(round(duration / PERIOD)):
            self.time += PERIOD
            x, y, z = self.force
            sensors = SimpleNamespace(acc_x=x, acc_y=y, acc_z=z)
            self.supervisor.update(self.time, sensors, self.setpoint_age, self.motors_run)
        return self.supervisor.state


def test_a_fault_of_a_deck_ends_a_flight_and_the_next_does_not_begin(flying):
    assert SupervisorState.DECK_FAULT not in flying.supervisor.flags
    flying.supervisor.has_deck_fault = True
    assert flying.run(0.1) is State.LOCKED
    assert {SupervisorState.DECK_FAULT, SupervisorState.LOCKED} <= set(flying.supervisor.flags)


@pytest.mark.parametrize("auto_arm", [True, False])
def test_a_vehicle_with_a_fault_of_a_deck_is_not_armed(auto_arm):
    hand = Hand(auto_arm)
    hand.run(0.2)
    hand.supervisor.has_deck_fault = True
    assert hand.run(0.2) is State.PRE_FL_CHECKS_NOT_PASSED
    assert not hand.supervisor.arm(True)
    assert hand.run(0.2) is State.PRE_FL_CHECKS_NOT_PASSED
    hand.supervisor.has_deck_fault = False
    assert hand.run(0.2) is (State.READY_TO_FLY if auto_arm else State.PRE_FL_CHECKS_PASSED)


@pytest.fixture
def flying():
    hand = Hand()
    assert hand.run(0.2) is State.READY_TO_FLY
    hand.motors_run = True
    assert hand.run(0.2) is State.FLYING
    return hand


def test_each_state_has_transitions_and_all_but_the_last_can_be_left():
    assert set(TRANSITIONS) == set(State)
    assert [state for state, ways in TRANSITIONS.items() if not ways] == [State.LOCKED]
    reached = {transition.to for ways in TRANSITIONS.values() for transition in ways}
    assert reached == set(State)


def test_motors_that_stop_are_no_landing_when_the_stream_ends():
    hand = Hand()
    hand.run(0.2)
    hand.motors_run = True
    hand.run(1.0)
    hand.motors_run = False
    hand.run(1.5)
    # Streamed for 0.9 s without thrust, then nothing.
    hand.setpoint_age = 0.6
    assert hand.run(0.6) is State.WARNING_LEVEL_OUT
    hand.setpoint_age = 2.1
    assert hand.run(2 * PERIOD) is State.LOCKED
    assert hand.said == ["SUP: Locked, reboot required"]


def test_levelling_overrides_all_but_the_height(flying):
    flying.setpoint_age = 1.0
    flying.run(PERIOD)
    given = Setpoint(mode=Modes(x=VELOCITY), vx=1.0, roll=20.0, yaw_rate=30.0, thrust=40000.0)
    flown = flying.supervisor.override(given)
    assert (flown.mode.x, flown.mode.y, flown.roll, flown.pitch) == (DISABLED, DISABLED, 0.0, 0.0)
    assert (flown.yaw_rate, flown.thrust) == (0.0, 40000.0)


def test_levelling_ends_with_a_setpoint_and_disarming_has_an_effect_only_then(flying):
    flying.setpoint_age = 1.0
    assert flying.run(PERIOD) is State.WARNING_LEVEL_OUT
    flying.setpoint_age = 0.0
    assert flying.run(PERIOD) is State.FLYING
    flying.setpoint_age = 1.0
    flying.run(PERIOD)
    flying.supervisor.arm(False)
    assert flying.run(0.4) is State.WARNING_LEVEL_OUT
    flying.setpoint_age = 0.0
    assert flying.run(2 * PERIOD) is State.RESET


def test_a_hard_shock_is_a_crash_where_its_limit_is_set(flying):
    flying.force = (4.0, 0.0, 1.0)
    assert flying.run(PERIOD) is State.FLYING
    assert flying.supervisor.acceleration == pytest.approx(17**0.5)
    flying.supervisor.crash_detect_gs = 3.0
    assert flying.run(PERIOD) is State.CRASHED


@pytest.fixture
def brushless():
    hand = Hand(auto_arm=False)
    hand.supervisor.motor_speeds = (0, 0, 0, 0)
    hand.run(0.2)
    assert hand.supervisor.arm(True)
    assert hand.run(0.2) is State.ARMING
    return hand


def test_motors_that_idle_end_the_arming(brushless):
    assert brushless.supervisor.motors_may_run
    assert not brushless.supervisor.can_fly
    brushless.supervisor.motor_speeds = (1000, 3500, 2000, 2000)
    assert brushless.run(0.2) is State.ARMING
    assert brushless.run(PERIOD) is State.READY_TO_FLY


@pytest.mark.parametrize("speed", [0, 999, 3501])
def test_a_motor_that_does_not_idle_disarms(brushless, speed):
    brushless.supervisor.motor_speeds = (2000, 2000, speed, 2000)
    assert brushless.run(0.76) is State.ARMING
    assert brushless.run(0.2) is State.PRE_FL_CHECKS_PASSED
    assert not brushless.supervisor.is_armed
    text = f"SUP: arming failed, the motors do not idle: 2000, 2000, {speed}, 2000 rpm"
    assert brushless.said == [text]


@pytest.mark.parametrize("runs", [True, False])
def test_a_motor_that_hardly_turns_stops_all_of_them(brushless, runs):
    brushless.supervisor.motor_speeds = (2000,) * 4
    assert brushless.run(0.28) is State.READY_TO_FLY
    brushless.motors_run = runs
    brushless.supervisor.motor_speeds = (2000, 2000, 2000, 499)
    assert brushless.run(0.2).name == ("FLYING" if runs else "READY_TO_FLY")
    assert brushless.run(2 * PERIOD) is State.LOCKED
    assert brushless.said == [
        "SUP: motors not responding: M4",
        "SUP: Locked, reboot required",
    ]


def test_tumbling_while_levelling_out_locks(flying):
    flying.setpoint_age = 1.0
    flying.force = (0.5, 0.0, -0.5)
    flying.run(0.2)
    assert flying.run(PERIOD) is State.LOCKED
    assert not flying.supervisor.is_crashed


@pytest.mark.parametrize(("force", "after"), [(0.4, 1.04), (-0.5, 0.16)])
def test_tumbling(flying, force, after):
    flying.force = (0.5, 0.0, force)
    assert flying.run(after - 2 * PERIOD) is State.FLYING
    assert flying.run(3 * PERIOD) is State.CRASHED
    assert flying.supervisor.is_tumbled
    assert not flying.supervisor.recover()
    flying.force = (0.0, 0.0, 1.0)
    flying.motors_run = False
    flying.run(PERIOD)
    assert flying.supervisor.recover()
    # Its motors ran less than 2 s ago, then long enough ago.
    assert flying.run(6 * PERIOD) is State.FLYING
    assert flying.run(2.0) is State.LANDED


def test_an_emergency_locks_the_crashed(flying):
    flying.force = (0.0, 0.0, -1.0)
    assert flying.run(0.4) is State.CRASHED
    flying.supervisor.stop()
    assert flying.run(PERIOD) is State.LOCKED


def test_falling_is_not_tumbling(flying):
    flying.force = (0.05, -0.05, -0.05)
    assert flying.run(3.0) is State.FLYING


def test_tumble_check_can_be_switched_off(flying):
    flying.supervisor.tumble_check = 0
    flying.force = (0.0, 0.0, -1.0)
    assert flying.run(3.0) is State.FLYING


def test_disarming_the_landed_saves_the_wait(flying):
    flying.motors_run = False
    assert flying.run(2.1) is State.LANDED
    flying.supervisor.arm(False)
    assert flying.run(PERIOD) is State.RESET


def test_armed_and_not_flown():
    hand = Hand(auto_arm=False)
    hand.run(0.2)
    hand.supervisor.arm(True)
    assert hand.run(29.0) is State.READY_TO_FLY
    assert hand.run(1.2) is State.PRE_FL_CHECKS_PASSED
    assert not hand.supervisor.is_armed


def test_one_that_arms_by_itself_cannot_fly_for_a_moment_each_30_s():
    hand = Hand()
    hand.run(0.2)
    could = []
    for _ in range(round(65.0 / PERIOD)):
        hand.run(PERIOD)
        could.append(hand.supervisor.can_fly)
    assert could.count(False) == 2 * 3


def test_lying_on_the_back_it_cannot_be_armed():
    hand = Hand(auto_arm=False)
    hand.force = (0.0, 0.0, -1.0)
    hand.run(0.4)
    assert hand.run(0.4) is State.PRE_FL_CHECKS_NOT_PASSED
    assert not hand.supervisor.arm(True)
