"""The supervisor, which may stop the motors and override the setpoint; the battery's states.

The states and the transitions between them are a table, as in the firmware:
docs/functional-areas/supervisor of crazyflie-firmware explains the scheme. States, conditions and
their order are those of its release 2026.08. The recorded flights of that release confirm each
transition but these, of which there is no record: the one out of `State.READY_TO_FLY` by time, the
one out of `State.LANDED` by disarming, the one out of `State.WARNING_LEVEL_OUT` by tumbling, those
of `State.CRASHED`, and those by the fault of a deck or by the speed of a motor.
"""

import math
from collections.abc import Callable
from enum import Enum, Flag, auto
from functools import reduce
from operator import or_
from types import SimpleNamespace
from typing import NamedTuple

from crazyflie_model.limits import LEVEL_AGE, OFF_AGE
from crazyflie_model.supervisor import SupervisorState
from crazyflie_virtual.body import OPEN_CIRCUIT_VOLTAGES, Sensors, sag
from crazyflie_virtual.firmware.states import Setpoint


class State(Enum):
    """States of the supervisor; names as the firmware's supervisorState_t, texts as it prints."""

    PRE_FL_CHECKS_NOT_PASSED = "Pre-flight checks not passed"
    PRE_FL_CHECKS_PASSED = "Pre-flight checks passed"
    ARMING = "Arming"
    READY_TO_FLY = "Ready to fly"
    FLYING = "Flying"
    LANDED = "Landed"
    RESET = "Reset"
    WARNING_LEVEL_OUT = "Warning, level out"
    EXCEPT_FREE_FALL = "Exception, free fall"
    CRASHED = "Crashed"
    LOCKED = "Locked"


class Condition(Flag):
    """Conditions of transitions; names as the firmware's SUPERVISOR_CB."""

    ARMED = auto()
    IS_FLYING = auto()  #: A motor has run within the last 2 s.
    IS_TUMBLED = auto()
    COMMANDER_WDT_WARNING = auto()  #: The setpoint is older than 0.5 s.
    COMMANDER_WDT_TIMEOUT = auto()  #: The setpoint is older than 2 s.
    EMERGENCY_STOP = auto()
    CRASHED = auto()  #: The vehicle has not been recovered since the crash.
    PREFLIGHT_TIMEOUT = auto()  #: Armed for `Supervisor.preflight_timeout`.
    DECK_FAULT = auto()  #: A deck has reported a fault of its hardware.
    LANDING_TIMEOUT = auto()  #: Landed for `Supervisor.landed_timeout`.
    SPEEDS_VALID = auto()  #: All motors idle, by their telemetry; always true without.
    SPINUP_TIMEOUT = auto()  #: Arming for `Supervisor.spinup_timeout`.
    MOTORS_NOT_RESPONDING = auto()  #: A motor that should turn hardly does, by its telemetry.
    ALWAYS = auto()


class Transition(NamedTuple):
    """A transition, made when any condition of ``when`` holds, or any of ``unless`` does not."""

    to: State
    when: Condition = Condition(0)
    unless: Condition = Condition(0)


_S, _C = State, Condition
_FATAL_IN_AIR = _C.EMERGENCY_STOP | _C.DECK_FAULT | _C.MOTORS_NOT_RESPONDING

#: Transitions, of which the first one whose condition is met is made, one in each update.
TRANSITIONS: dict[State, tuple[Transition, ...]] = {
    _S.PRE_FL_CHECKS_NOT_PASSED: (
        Transition(_S.EXCEPT_FREE_FALL, when=_C.EMERGENCY_STOP),
        Transition(_S.PRE_FL_CHECKS_NOT_PASSED, when=_C.DECK_FAULT),
        Transition(_S.PRE_FL_CHECKS_PASSED, unless=_C.IS_TUMBLED),
    ),
    _S.PRE_FL_CHECKS_PASSED: (
        Transition(_S.EXCEPT_FREE_FALL, when=_C.EMERGENCY_STOP),
        Transition(_S.PRE_FL_CHECKS_NOT_PASSED, when=_C.IS_TUMBLED | _C.DECK_FAULT),
        Transition(_S.ARMING, when=_C.ARMED),
    ),
    _S.ARMING: (
        Transition(_S.EXCEPT_FREE_FALL, when=_C.EMERGENCY_STOP),
        Transition(
            _S.PRE_FL_CHECKS_NOT_PASSED, when=_C.IS_TUMBLED | _C.SPINUP_TIMEOUT, unless=_C.ARMED
        ),
        Transition(_S.READY_TO_FLY, when=_C.SPEEDS_VALID),
    ),
    _S.READY_TO_FLY: (
        Transition(_S.EXCEPT_FREE_FALL, when=_C.EMERGENCY_STOP | _C.MOTORS_NOT_RESPONDING),
        Transition(
            _S.PRE_FL_CHECKS_NOT_PASSED, when=_C.IS_TUMBLED | _C.DECK_FAULT, unless=_C.ARMED
        ),
        Transition(_S.FLYING, when=_C.IS_FLYING),
        Transition(_S.PRE_FL_CHECKS_NOT_PASSED, when=_C.PREFLIGHT_TIMEOUT),
    ),
    _S.FLYING: (
        Transition(_S.EXCEPT_FREE_FALL, when=_C.COMMANDER_WDT_TIMEOUT | _FATAL_IN_AIR),
        Transition(_S.CRASHED, when=_C.IS_TUMBLED),
        Transition(_S.RESET, unless=_C.ARMED),
        Transition(_S.WARNING_LEVEL_OUT, when=_C.COMMANDER_WDT_WARNING),
        Transition(_S.LANDED, unless=_C.IS_FLYING),
    ),
    _S.LANDED: (
        Transition(_S.EXCEPT_FREE_FALL, when=_C.MOTORS_NOT_RESPONDING),
        Transition(_S.RESET, when=_C.LANDING_TIMEOUT, unless=_C.ARMED),
        Transition(_S.FLYING, when=_C.IS_FLYING),
    ),
    _S.RESET: (Transition(_S.PRE_FL_CHECKS_NOT_PASSED, when=_C.ALWAYS),),
    # No transition to LANDED: without setpoints a vehicle is locked although its motors are off.
    _S.WARNING_LEVEL_OUT: (
        Transition(
            _S.EXCEPT_FREE_FALL, when=_C.COMMANDER_WDT_TIMEOUT | _C.IS_TUMBLED | _FATAL_IN_AIR
        ),
        # Disarming has an effect after that.
        Transition(_S.FLYING, unless=_C.COMMANDER_WDT_WARNING),
    ),
    _S.EXCEPT_FREE_FALL: (Transition(_S.LOCKED, when=_C.ALWAYS),),
    _S.CRASHED: (
        Transition(_S.PRE_FL_CHECKS_NOT_PASSED, unless=_C.CRASHED),
        Transition(_S.LOCKED, when=_C.EMERGENCY_STOP),
    ),
    _S.LOCKED: (),
}


def next_state(state: State, conditions: Condition) -> State:
    """Return the state after one update."""
    for transition in TRANSITIONS[state]:
        if conditions & transition.when or ~conditions & transition.unless:
            return transition.to
    return state


EMERGENCY_WATCHDOG = 1.0  #: Longest time between watchdog messages, after the first one, s.
#: Time with the motors off after which the vehicle has landed (s). Accelerometer reading along up
#: below which the vehicle has tumbled (g), and duration of that (s).
LANDED_AFTER = 2.0
_TILTED, _UPSIDE_DOWN = (0.5, 1.0), (-0.2, 0.1)
#: Accelerometer reading of all axes below which the vehicle is falling and not tumbled (g).
_FREE_FALL = 0.1

#: Speeds of motors (rpm) that idle, and the one below which a motor that turns does not respond;
#: the time for which they last (s).
_IDLE_SPEEDS, _LEAST_SPEED, _SPEEDS_LAST = (1000, 3500), 500, 0.2

_RUNNING = (State.READY_TO_FLY, State.FLYING, State.LANDED, State.WARNING_LEVEL_OUT)
_ARMED = (*_RUNNING, State.ARMING)
_IN_AIR = (State.FLYING, State.WARNING_LEVEL_OUT)


class Supervisor:
    """Decides whether the motors may run; ``write_line(text)`` prints on the console.

    With ``auto_arm`` it arms when the checks have passed, like a Crazyflie 2.1; otherwise the
    client arms, as with brushless motors.
    """

    def __init__(self, write_line: Callable[[str], None], auto_arm: bool = True):
        self._write_line = write_line
        self.auto_arm = auto_arm
        self.state = State.PRE_FL_CHECKS_NOT_PASSED
        self.is_armed = self.is_tumbled = self.is_crashed = False
        self.emergency_stop = 0  #: Parameter stabilizer.stop: not 0 stops the motors.
        self.tumble_check = 1  #: 0 for none.
        self.has_deck_fault = False  #: Whether a deck reports a fault of its hardware.
        #: preflight_timeout, landed_timeout: ms after which a vehicle is disarmed when it does not
        #: take off, and after landing. With automatic arming it cannot fly for four updates then.
        self.preflight_timeout, self.landed_timeout = 30000, 3000
        self.spinup_timeout = 1000  #: ms in which the motors of an arming vehicle idle: assumed.
        #: Deviation of `acceleration` from 1 g beyond which the vehicle has tumbled; 0 for none.
        self.crash_detect_gs = 0.0
        self.acceleration = 1.0  #: Norm of the accelerometer's reading, g.
        #: Speeds of the motors by their telemetry, rpm; empty for motors without.
        self.motor_speeds: tuple[int, ...] = ()
        self._emergency = False
        # Of the last watchdog message, the last thrust, and the beginning of a tumble (s).
        self._watchdog_time, self._thrust_time, self._tumble_time = math.inf, -math.inf, math.inf
        self._state_time = 0.0
        # Since when the motors have idled, and since when one has not responded (s).
        self._idle_time = self._failure_time = math.inf

    @property
    def can_fly(self) -> bool:
        """Whether setpoints are flown."""
        return self.state in _RUNNING

    @property
    def motors_may_run(self) -> bool:
        """Whether the motors at least idle."""
        return self.state in _ARMED

    @property
    def is_flying(self) -> bool:
        """Whether the vehicle is in the air, as the supervisor sees it."""
        return self.state in _IN_AIR

    @property
    def flags(self) -> SupervisorState:
        """The state as clients see it."""
        return SupervisorState.of(
            can_be_armed=self.state is State.PRE_FL_CHECKS_PASSED,
            armed=self.is_armed,
            auto_armed=self.auto_arm,
            can_fly=self.can_fly,
            flying=self.is_flying,
            tumbled=self.is_tumbled,
            locked=self.state is State.LOCKED,
            crashed=self.is_crashed,
            deck_fault=self.has_deck_fault,
        )

    def arm(self, do_arm: bool) -> bool:
        """Arm or disarm; return whether that was possible."""
        if do_arm and not self.is_armed and self.state is not State.PRE_FL_CHECKS_PASSED:
            return False
        self.is_armed = do_arm
        return True

    def recover(self) -> bool:
        """End the crashed state, if the vehicle is upright; return whether it has ended."""
        if self.is_crashed and self.is_tumbled:
            return False
        self.is_crashed = False
        return True

    def stop(self) -> None:
        """Stop the motors; only a restart ends that."""
        self._emergency = True

    def feed_watchdog(self, time: float) -> None:
        """Restart the emergency watchdog, which runs from the first call on."""
        self._watchdog_time = time

    def update(self, time: float, sensors: Sensors, setpoint_age: float, motors_run: bool) -> None:
        """Update the state at ``time`` (s), with a setpoint of some age (s).

        ``motors_run`` is whether any motor is commanded more than idle.
        """
        if motors_run:
            self._thrust_time = time
        runs = time - self._thrust_time < LANDED_AFTER
        has_tumbled = self._has_tumbled(time, sensors)
        self.is_tumbled = bool(self.tumble_check) and has_tumbled
        state = next_state(self.state, self._conditions(time, setpoint_age, runs))
        if state is self.state:
            return
        if state is State.EXCEPT_FREE_FALL and self._lasts(time, self._failure_time):
            numbers = [f"M{i}" for i, rpm in enumerate(self.motor_speeds, 1) if rpm < _LEAST_SPEED]
            self._write_line(f"SUP: motors not responding: {', '.join(numbers)}")
        if self.state is State.ARMING and self._waited(time, self.spinup_timeout):
            speeds = ", ".join(map(str, self.motor_speeds))
            self._write_line(f"SUP: arming failed, the motors do not idle: {speeds} rpm")
        self.state = state
        self._state_time = time
        if state is State.CRASHED:
            self.is_crashed = True
        if state not in _ARMED:
            self.is_armed = False
        if state is State.PRE_FL_CHECKS_PASSED and self.auto_arm:
            self.is_armed = True
        if state in (State.LOCKED, State.CRASHED):
            remedy = "reboot" if state is State.LOCKED else "recovery"
            self._write_line(f"SUP: {state.value}, {remedy} required")

    def override(self, setpoint: Setpoint) -> Setpoint:
        """Return the setpoint for the controllers: the commander's, levelled, or none."""
        if not self.can_fly:
            return Setpoint(time=setpoint.time)
        return setpoint.leveled() if self.state is State.WARNING_LEVEL_OUT else setpoint

    def _conditions(self, time, setpoint_age, runs):
        speeds, (least, most) = self.motor_speeds, _IDLE_SPEEDS
        idles = self.state is State.ARMING and all(least <= rpm <= most for rpm in speeds)
        self._idle_time = min(self._idle_time, time) if idles else math.inf
        fails = self.can_fly and any(0 < rpm < _LEAST_SPEED for rpm in speeds)
        self._failure_time = min(self._failure_time, time) if fails else math.inf
        holding = {
            Condition.ARMED: self.is_armed,
            Condition.IS_FLYING: runs,
            Condition.IS_TUMBLED: self.is_tumbled,
            Condition.COMMANDER_WDT_WARNING: setpoint_age > LEVEL_AGE,
            Condition.COMMANDER_WDT_TIMEOUT: setpoint_age > OFF_AGE,
            Condition.EMERGENCY_STOP: self._is_emergency(time),
            Condition.CRASHED: self.is_crashed,
            Condition.DECK_FAULT: self.has_deck_fault,
            Condition.PREFLIGHT_TIMEOUT: self._waited(time, self.preflight_timeout),
            Condition.LANDING_TIMEOUT: self._waited(time, self.landed_timeout),
            Condition.SPINUP_TIMEOUT: self._waited(time, self.spinup_timeout),
            Condition.SPEEDS_VALID: not speeds or self._lasts(time, self._idle_time),
            Condition.MOTORS_NOT_RESPONDING: self._lasts(time, self._failure_time),
        }
        return reduce(or_, (each for each in holding if holding[each]), Condition.ALWAYS)

    def _waited(self, time, timeout):
        return time - self._state_time > timeout / 1000.0

    @staticmethod
    def _lasts(time: float, since: float) -> bool:
        return time - since >= _SPEEDS_LAST

    def _is_emergency(self, time):
        starved = time - self._watchdog_time > EMERGENCY_WATCHDOG
        return self._emergency or starved or bool(self.emergency_stop)

    def _has_tumbled(self, time, sensors):
        forces = (sensors.acc_x, sensors.acc_y, sensors.acc_z)
        self.acceleration = math.hypot(*forces)
        if 0.0 < self.crash_detect_gs < abs(self.acceleration - 1.0):
            return True
        is_falling = all(abs(force) < _FREE_FALL for force in forces)
        if is_falling or sensors.acc_z >= _TILTED[0]:
            self._tumble_time = math.inf
            return False
        self._tumble_time = min(self._tumble_time, time)
        lasted = time - self._tumble_time
        return lasted > _TILTED[1] or (sensors.acc_z < _UPSIDE_DOWN[0] and lasted > _UPSIDE_DOWN[1])


ON_BATTERY, LOW = 0, 3  #: States of the battery; 1 and 2, charging and charged, do not occur.
_LOW_AFTER = 5.0  #: Time of low voltage until the state `LOW`, s.
#: Voltage, V, at 0, 10, ... 90 % of charge [firmware: measured on the stock battery at 25 C].
_LEVELS = OPEN_CIRCUIT_VOLTAGES[:-1]


_MAX_SAG = 0.95  #: Largest sag of a good battery in its self test (V): health.c of the firmware.
_LOAD = 1.0  #: Load of that test over the load of hover.


class Health:
    """Self tests of motors and battery; here they take no time, and the motors stand still."""

    def __init__(self, faults: SimpleNamespace):
        self._faults = faults
        self.motors_asked = self.battery_asked = 0  #: If not 0, the test begins.
        self.motors_passed = 0  #: Bit mask of the motors that have passed.
        self.battery_passed = 0
        self.battery_sag = 0.0  #: V.
        self.tests = 0  #: Number of tests that were done.

    def update(self) -> None:
        """Carry out the requested tests."""
        if self.motors_asked:
            self.motors_asked = 0
            failed = self._faults.motor_failure
            self.motors_passed = 0b1111 & ~(1 << failed - 1 if failed else 0)
            self.tests += 1
        if self.battery_asked:
            self.battery_asked = 0
            self.battery_sag = sag(_LOAD)
            self.battery_passed = int(self.battery_sag < _MAX_SAG and not self._faults.low_battery)
            self.tests += 1


class PowerMonitor:
    """Watches the voltage."""

    def __init__(self) -> None:
        self.voltage = 4.1  #: V.
        self.level = 90  #: Charge as the firmware estimates it from the voltage, %.
        self.state = ON_BATTERY  #: `ON_BATTERY` or `LOW`.
        #: low_voltage, critical_voltage: V. The second has no effect: the default build does not
        #: switch itself off.
        self.low_voltage, self.critical_voltage = 3.2, 3.0
        self._good_time = math.inf

    @property
    def millivolts(self) -> float:
        """Voltage, mV."""
        return 1000.0 * self.voltage

    def update(self, time: float, voltage: float) -> None:
        """Update with the voltage (V) at a time (s)."""
        self.voltage = voltage
        self.level = 10 * min(9, sum(voltage > level for level in _LEVELS))
        self._good_time = time if voltage > self.low_voltage else min(self._good_time, time)
        self.state = LOW if time - self._good_time > _LOW_AFTER else ON_BATTERY
