"""The supervisor's states, with sensors and clock moved by hand."""

from types import SimpleNamespace

import pytest

from crazyflie_virtual.firmware.states import DISABLED, VELOCITY, Modes, Setpoint
from crazyflie_virtual.firmware.supervisor import State, Supervisor

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
        """Let time pass; return the state."""
        for _ in range(round(duration / PERIOD)):
            self.time += PERIOD
            x, y, z = self.force
            sensors = SimpleNamespace(acc_x=x, acc_y=y, acc_z=z)
            self.supervisor.update(self.time, sensors, self.setpoint_age, self.motors_run)
        return self.supervisor.state


@pytest.fixture
def flying():
    hand = Hand()
    assert hand.run(0.2) is State.READY
    hand.motors_run = True
    assert hand.run(0.2) is State.FLYING
    return hand


def test_ages_of_the_setpoint(flying):
    flying.setpoint_age = 0.5
    assert flying.run(PERIOD) is State.FLYING
    flying.setpoint_age = 0.51
    assert flying.run(PERIOD) is State.LEVELLING
    flying.setpoint_age = 0.0
    assert flying.run(PERIOD) is State.FLYING
    flying.setpoint_age = 2.01
    assert flying.run(PERIOD) is State.LOCKED
    flying.setpoint_age = 0.0
    assert flying.run(10.0) is State.LOCKED
    assert flying.said == ["SUP: Locked, reboot required"]
    assert flying.supervisor.flags == 0b1000100


def test_old_setpoints_on_the_ground_are_no_reason_to_lock():
    hand = Hand()
    hand.setpoint_age = 60.0
    assert hand.run(5.0) is State.READY


def test_motors_that_stop_are_a_landing_even_when_the_stream_ends():
    hand = Hand()
    hand.run(0.2)
    hand.motors_run = True
    hand.run(1.0)
    hand.motors_run = False
    assert hand.run(1.5) is State.FLYING
    # Streamed for 0.5 s without thrust, then nothing.
    hand.setpoint_age = 1.6
    assert hand.run(0.5) is State.READY


def test_levelling_overrides_all_but_the_height(flying):
    flying.setpoint_age = 1.0
    flying.run(PERIOD)
    given = Setpoint(mode=Modes(x=VELOCITY), vx=1.0, roll=20.0, yaw_rate=30.0, thrust=40000.0)
    flown = flying.supervisor.override(given)
    assert (flown.mode.x, flown.mode.y, flown.roll, flown.pitch) == (DISABLED, DISABLED, 0.0, 0.0)
    assert (flown.yaw_rate, flown.thrust) == (0.0, 40000.0)


def test_locked_overrides_everything(flying):
    flying.supervisor.stop()
    assert flying.run(PERIOD) is State.LOCKED
    assert flying.supervisor.override(Setpoint(thrust=40000.0)).thrust == 0.0


def test_emergency_watchdog_bites_only_once_it_was_fed(flying):
    assert flying.run(3.0) is State.FLYING
    for _ in range(4):
        flying.supervisor.feed_watchdog(flying.time)
        assert flying.run(0.96) is State.FLYING
    assert flying.run(0.08) is State.LOCKED


def test_parameter_stop(flying):
    flying.supervisor.emergency_stop = 1
    assert flying.run(PERIOD) is State.LOCKED


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
    assert flying.run(3.0) is State.READY


def test_falling_is_not_tumbling(flying):
    flying.force = (0.05, -0.05, -0.05)
    assert flying.run(3.0) is State.FLYING


def test_tumble_check_can_be_switched_off(flying):
    flying.supervisor.tumble_check = 0
    flying.force = (0.0, 0.0, -1.0)
    assert flying.run(3.0) is State.FLYING


def test_armed_by_the_client():
    hand = Hand(auto_arm=False)
    assert hand.run(1.0) is State.CHECKED
    assert hand.supervisor.arm(True)
    assert hand.run(PERIOD) is State.READY
    hand.motors_run = True
    assert hand.run(PERIOD) is State.FLYING
    hand.motors_run = False
    assert hand.run(2.5) is State.LANDED
    # Disarmed 3 s after landing.
    assert hand.run(3.0) is State.CHECKED
    assert not hand.supervisor.is_armed


def test_armed_and_not_flown():
    hand = Hand(auto_arm=False)
    hand.run(0.2)
    hand.supervisor.arm(True)
    assert hand.run(29.0) is State.READY
    assert hand.run(1.2) is State.CHECKED


def test_disarming_in_flight_locks(flying):
    flying.supervisor.arm(False)
    assert flying.run(PERIOD) is State.LOCKED


def test_lying_on_the_back_it_cannot_be_armed():
    hand = Hand(auto_arm=False)
    hand.force = (0.0, 0.0, -1.0)
    hand.run(0.4)
    assert hand.run(0.4) is State.NOT_READY
    assert not hand.supervisor.arm(True)
