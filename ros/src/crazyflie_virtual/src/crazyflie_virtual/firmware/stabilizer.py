"""The cascade of controllers and the mixer: from setpoint and estimate to motor commands."""

import math

from crazyflie_model.angles import Triple, zyx_from_quaternion
from crazyflie_model.inner_loops import PERIOD, limit, mix
from crazyflie_virtual.body import OFF, MotorCommands, Sensors
from crazyflie_virtual.firmware.controllers import (
    AttitudeController,
    PositionController,
    wrap_degrees,
)
from crazyflie_virtual.firmware.mellinger import MellingerController
from crazyflie_virtual.firmware.states import (
    ABSOLUTE,
    DISABLED,
    VELOCITY,
    Estimate,
    Modes,
    Setpoint,
)

IDLE_THRUST = 7000  #: Thrust of armed vehicles with brushless motors on the ground (PWM).
DEFAULT, PID, MELLINGER = 0, 1, 2  #: Numbers of controllers; the default one is `PID`.


class MotorOverride:
    """Motor commands set by parameter, for tests on the bench."""

    def __init__(self) -> None:
        #: 0 to disable, 1 for a command of each motor, 2 for that of motor 1 on all.
        self.enable = 0
        self.m1 = self.m2 = self.m3 = self.m4 = 0  #: PWM.

    def commands(self) -> MotorCommands | None:
        """Return the commands in force, or None."""
        if self.enable == 1:
            return MotorCommands(*map(float, (self.m1, self.m2, self.m3, self.m4)))
        return MotorCommands(*(float(self.m1),) * 4) if self.enable else None


class Stabilizer:
    """The controllers of one vehicle."""

    def __init__(self, idle_thrust: int = 0, has_attitude_loops: bool = True) -> None:
        self.controller = PID  #: `DEFAULT`, `PID` or `MELLINGER`.
        self.attitude = AttitudeController()
        self.position = PositionController()
        self.mellinger = MellingerController()
        self.override = MotorOverride()
        self._has_attitude_loops = has_attitude_loops
        self.idle_thrust = idle_thrust  #: Least command of an armed motor, PWM.
        self.roll = self.pitch = self.yaw = 0.0  #: Desired attitude, deg.
        self.roll_rate = self.pitch_rate = self.yaw_rate = 0.0  #: Desired body rates, deg/s.
        #: Desired roll and pitch (rad, nose down) and yaw rate (rad/s): commands of a body that has
        #: lags in place of attitude loops.
        self.desired: Triple = (0.0, 0.0, 0.0)
        #: Inputs of the mixer, PWM.
        self.thrust = self.command_roll = self.command_pitch = self.command_yaw = 0.0
        self.requested = self.commands = OFF  #: Motor commands before and after their limits.
        self._automatic = (0.0, 0.0, 0.0)
        self._mode = Modes()
        self._last_controller = self.controller

    def update(
        self,
        setpoint: Setpoint,
        estimate: Estimate,
        sensors: Sensors,
        with_position: bool,
        may_run: bool,
    ) -> MotorCommands:
        """Return the motor commands.

        The position controller runs in a step ``with_position``; ``may_run`` is whether the
        supervisor lets motors run.
        """
        if self.controller != self._last_controller:
            self._last_controller = self.controller
            self._idle(estimate)
        if self.controller == MELLINGER:
            outputs = self.mellinger.update(setpoint, estimate, sensors)
            self.roll, self.pitch, self.yaw = self.mellinger.attitude
            self.yaw_rate = self.attitude.desired_rates(estimate, 0.0, 0.0, self.yaw)[2]
            self.thrust, self.command_roll, about_left, self.command_yaw = outputs
            self.command_pitch = -about_left
        else:
            self._run_pid(setpoint, estimate, sensors, with_position)
        turn = setpoint.yaw_rate if setpoint.mode.yaw == VELOCITY else self.yaw_rate
        self.desired = math.radians(self.roll), -math.radians(self.pitch), math.radians(turn)
        if not self._has_attitude_loops:
            self.command_roll = self.command_pitch = self.command_yaw = 0.0
        # The mixer's pitch is positive nose down.
        inputs = (self.thrust, self.command_roll, -self.command_pitch, self.command_yaw)
        mixed = MotorCommands(*mix(*inputs)) if self.thrust > 0.0 else OFF
        self.requested = self.override.commands() or mixed
        idle = float(self.idle_thrust)
        self.commands = MotorCommands(*limit(self.requested, idle)) if may_run else OFF
        return self.commands

    def _run_pid(self, setpoint, estimate, sensors, with_position):
        mode = setpoint.mode
        if mode != self._mode:
            self._mode = mode
            self._reset(estimate)
        if with_position and mode[:3] != (DISABLED,) * 3:
            self._automatic = self.position.update(setpoint, estimate)
        self._update_desired_yaw(setpoint, estimate)
        self.roll, self.pitch, self.thrust = self._automatic
        if DISABLED in (mode.x, mode.y):
            self.roll, self.pitch = setpoint.roll, setpoint.pitch
        if mode.z == DISABLED:
            self.thrust = setpoint.thrust
        if self.thrust <= 0.0:
            self._idle(estimate)
            return
        rates = self.attitude.desired_rates(estimate, self.roll, self.pitch, self.yaw)
        self.roll_rate, self.pitch_rate, self.yaw_rate = rates
        if mode.roll == VELOCITY:
            self.roll_rate = setpoint.roll_rate
        if mode.pitch == VELOCITY:
            self.pitch_rate = setpoint.pitch_rate
        self.command_roll, self.command_pitch, self.command_yaw = self.attitude.outputs(
            (self.roll_rate, self.pitch_rate, self.yaw_rate),
            (sensors.gyro_x, -sensors.gyro_y, sensors.gyro_z),
        )

    def _reset(self, estimate):
        self.attitude.reset()
        self.position.reset()
        self._automatic = (estimate.roll, estimate.pitch, 0.0)

    def _update_desired_yaw(self, setpoint, estimate):
        if setpoint.mode.yaw == VELOCITY:
            # A commanded yaw rate changes the desired heading.
            yaw = self.yaw + setpoint.yaw_rate * PERIOD
            most = self.attitude.yaw_max_delta
            if most > 0.0:
                ahead = wrap_degrees(yaw - estimate.yaw)
                yaw = estimate.yaw + max(-most, min(most, ahead))
            self.yaw = wrap_degrees(yaw)
        elif setpoint.mode.yaw == ABSOLUTE:
            self.yaw = wrap_degrees(setpoint.yaw)
        elif setpoint.mode.quaternion == ABSOLUTE:
            self.yaw = math.degrees(zyx_from_quaternion(setpoint.quaternion)[2])

    def _idle(self, estimate):
        # Without thrust the controllers are reset, and the desired heading is the vehicle's.
        self._reset(estimate)
        self.mellinger.reset()
        self.yaw = estimate.yaw
        self.command_roll = self.command_pitch = self.command_yaw = 0.0
