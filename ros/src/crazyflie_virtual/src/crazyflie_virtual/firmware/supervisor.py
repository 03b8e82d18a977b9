"""The supervisor: may the motors run, and what overrides the setpoint. 25 Hz."""

from collections.abc import Callable

from crazyflie_model.limits import LEVEL_AGE, OFF_AGE
from crazyflie_model.supervisor import SupervisorState
from crazyflie_virtual.body.sensors import Sensors
from crazyflie_virtual.firmware.states import Setpoint
from crazyflie_virtual.firmware.supervisor_states import Condition, State, next_state

EMERGENCY_WATCHDOG = 1.0  #: Longest time between watchdog messages, after the first one, s.
_LANDED_AFTER = 2.0  #: How long the motors are off until the vehicle is not flying, s.
#: Accelerometer along up, g, below which the vehicle has tumbled, and after how long, s.
_TILTED, _UPSIDE_DOWN = (0.5, 1.0), (-0.2, 0.1)
#: Accelerometer, g, below which in all axes the vehicle is falling and not tumbled.
_FREE_FALL = 0.1

_RUNNING = (State.READY_TO_FLY, State.FLYING, State.LANDED, State.WARNING_LEVEL_OUT)
_ARMED = (*_RUNNING, State.ARMING)
_IN_AIR = (State.FLYING, State.WARNING_LEVEL_OUT)


class Supervisor:
    """Decides whether the motors may run; ``write_line(text)`` prints on the console.

    With ``auto_arm`` it arms when the checks have passed, as a Crazyflie 2.1 does; otherwise the
    client arms, as with brushless motors.
    """

    def __init__(self, write_line: Callable[[str], None], auto_arm: bool = True):
        self._write_line = write_line
        self.auto_arm = auto_arm
        self.state = State.PRE_FL_CHECKS_NOT_PASSED
        self.is_armed = self.is_tumbled = self.is_crashed = False
        self.emergency_stop = 0  #: Parameter stabilizer.stop: not 0 stops the motors.
        self.tumble_check = 1  #: 0 for none.
        #: preflight_timeout, landed_timeout: ms after which a vehicle is disarmed when it does not
        #: take off, and after landing. With automatic arming it cannot fly for four updates then.
        self.preflight_timeout, self.landed_timeout = 30000, 3000
        self._emergency = False
        self._watchdog_time: float | None = None
        self._thrust_time: float | None = None
        self._tumble_time: float | None = None
        self._state_time = 0.0

    @property
    def can_fly(self) -> bool:
        """Whether setpoints are flown."""
        return self.state in _RUNNING

    @property
    def motors_may_run(self) -> bool:
        """Whether the motors idle at least."""
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
        runs = self._thrust_time is not None and time - self._thrust_time < _LANDED_AFTER
        self.is_tumbled = bool(self.tumble_check) and self._has_tumbled(time, sensors)
        state = next_state(self.state, self._conditions(time, setpoint_age, runs))
        if state is self.state:
            return
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
        holding = {
            Condition.ARMED: self.is_armed,
            Condition.IS_FLYING: runs,
            Condition.IS_TUMBLED: self.is_tumbled,
            Condition.COMMANDER_WDT_WARNING: setpoint_age > LEVEL_AGE,
            Condition.COMMANDER_WDT_TIMEOUT: setpoint_age > OFF_AGE,
            Condition.EMERGENCY_STOP: self._is_emergency(time),
            Condition.CRASHED: self.is_crashed,
            Condition.PREFLIGHT_TIMEOUT: self._waited(time, self.preflight_timeout),
            Condition.LANDING_TIMEOUT: self._waited(time, self.landed_timeout),
        }
        conditions = Condition.ALWAYS
        for condition, holds in holding.items():
            if holds:
                conditions |= condition
        return conditions

    def _waited(self, time, timeout):
        return time - self._state_time > timeout / 1000.0

    def _is_emergency(self, time):
        fed = self._watchdog_time
        starved = fed is not None and time - fed > EMERGENCY_WATCHDOG
        return self._emergency or starved or bool(self.emergency_stop)

    def _has_tumbled(self, time, sensors):
        forces = (sensors.acc_x, sensors.acc_y, sensors.acc_z)
        is_falling = all(abs(force) < _FREE_FALL for force in forces)
        if is_falling or sensors.acc_z >= _TILTED[0]:
            self._tumble_time = None
            return False
        if self._tumble_time is None:
            self._tumble_time = time
        lasted = time - self._tumble_time
        return lasted > _TILTED[1] or (sensors.acc_z < _UPSIDE_DOWN[0] and lasted > _UPSIDE_DOWN[1])
