"""The cascade of PID controllers: position and velocity, 100 Hz, attitude and rates, 500 Hz.

In the heading frame, errors of the position set a velocity, and errors of the velocity set roll,
pitch and thrust. Errors of the attitude set body rates, and errors of the rates set the differences
of the motors' thrust in the mixer. Structure and gains are those of the Crazyflie
2.1's firmware (2024, controller PID); `crazyflie_model.inner_loops` has the inner loops without the
firmware's modes, parameters and log variables.
"""

import math
from math import isnan

from crazyflie_model.angles import Triple, rotate_by_yaw
from crazyflie_model.inner_loops import (
    HEADING,
    HEADING_RATE,
    OUTPUT_LIMIT,
    PERIOD,
    TILT,
    TILT_RATE,
    Gains,
    terms,
)
from crazyflie_model.limits import FULL_PWM
from crazyflie_virtual.firmware.states import ABSOLUTE, Estimate, Setpoint


class FirmwarePid:
    """PID with feed-forward; the derivative is that of the measurement.

    ``gains`` are the initial gains, which a client may change. ``dt`` is the time between two
    updates, s; ``kff`` the output per desired value; ``output_limit`` that of the output's
    magnitude, 0 for none.
    """

    def __init__(self, gains: Gains, dt: float, kff: float = 0.0, output_limit: float = 0.0):
        #: kp, ki, kd, kff, limit: Present gains.
        self.kp, self.ki, self.kd, self.kff = gains.kp, gains.ki, gains.kd, kff
        self.limit = gains.limit
        self.output_limit = output_limit
        self._dt = dt
        self._integral = 0.0
        self._last: float | None = None
        #: desired, out_p, out_i, out_d, out_ff: Values of the last update, for the log.
        self.desired = 0.0
        self.out_p = self.out_i = self.out_d = self.out_ff = 0.0

    def reset(self) -> None:
        """Reset integral and last measurement."""
        self._integral = 0.0
        self._last = None

    def update(self, desired: float, measured: float, error: float | None = None) -> float:
        """Return the output; ``error`` replaces a difference that must be wrapped."""
        self.desired = desired
        if error is None:
            error = desired - measured
        slope = 0.0 if self._last is None else (measured - self._last) / self._dt
        self._last = measured
        self.out_p, self.out_i, self.out_d, self._integral = terms(
            # The object has the attributes of Gains, but clients change them.
            self,  # type: ignore[arg-type]
            error,
            self._integral,
            slope,
            self._dt,
        )
        self.out_ff = self.kff * desired
        if isnan(self._integral):
            self._integral = -self.limit
        output = self.out_p + self.out_i + self.out_d + self.out_ff
        most = self.output_limit
        return constrain(output, -most, most) if most > 0.0 else output


def constrain(value: float, low: float, high: float) -> float:
    """Return ``value`` limited to [low, high]; ``low`` for NaN, as C's fmaxf does."""
    return high if value > high else value if value >= low else low


def wrap_degrees(angle: float) -> float:
    """Return the angle in [-180, 180) that points the same way, deg."""
    return (angle + 180.0) % 360.0 - 180.0


class AttitudeController:
    """Controllers from desired attitude or rates to the outputs about the three axes."""

    def __init__(self) -> None:
        self.roll = FirmwarePid(TILT, PERIOD)  #: roll, pitch, yaw: deg to deg/s.
        self.pitch = FirmwarePid(TILT, PERIOD)
        self.yaw = FirmwarePid(HEADING, PERIOD)
        #: roll_rate, pitch_rate, yaw_rate: deg/s to PWM.
        self.roll_rate = FirmwarePid(TILT_RATE, PERIOD)
        self.pitch_rate = FirmwarePid(TILT_RATE, PERIOD)
        self.yaw_rate = FirmwarePid(HEADING_RATE, PERIOD)
        #: Largest difference of desired and actual heading (deg); 0 for no limit.
        self.yaw_max_delta = 0.0

    def reset(self) -> None:
        """Reset integrals and last measurements."""
        rates = (self.roll_rate, self.pitch_rate, self.yaw_rate)
        for pid in (self.roll, self.pitch, self.yaw, *rates):
            pid.reset()

    def desired_rates(self, estimate: Estimate, roll: float, pitch: float, yaw: float) -> Triple:
        """Return the body rates (deg/s) for a desired attitude (deg)."""
        yaw_error = wrap_degrees(yaw - estimate.yaw)
        return (
            self.roll.update(roll, estimate.roll),
            self.pitch.update(pitch, estimate.pitch),
            # The measured heading is unwrapped to the desired one; otherwise the derivative would
            # jump where the heading wraps.
            self.yaw.update(yaw, yaw - yaw_error, yaw_error),
        )

    def outputs(self, rates: Triple, gyro: Triple) -> Triple:
        """Return the outputs about roll, pitch and yaw for desired body rates, PWM.

        Rates desired and measured (``gyro``) are in deg/s, pitch in the firmware's sign.
        """
        return (
            _to_16_bits(self.roll_rate.update(rates[0], gyro[0])),
            _to_16_bits(self.pitch_rate.update(rates[1], gyro[1])),
            _to_16_bits(self.yaw_rate.update(rates[2], gyro[2])),
        )


def _to_16_bits(output):
    # NaN becomes 0, as an x86 converts it.
    return 0.0 if isnan(output) else constrain(output, -OUTPUT_LIMIT, OUTPUT_LIMIT)


DT = 0.01  #: Time between two updates, s.
#: Fraction of a limit by which the output may exceed it, so that it can leave it again.
_OVERHEAD = 1.1
_THRUST_SCALE = 1000.0  #: PWM per unit of the climb controller's output.


class PositionController:
    """From a setpoint's position or velocity to attitude and thrust."""

    def __init__(self) -> None:
        self.x = FirmwarePid(Gains(2.0, 0.0, 0.0), DT)  #: x, y, z: m to m/s.
        self.y = FirmwarePid(Gains(2.0, 0.0, 0.0), DT)
        self.z = FirmwarePid(Gains(2.0, 0.5, 0.0), DT)
        #: vx, vy, vz: m/s to deg, deg and thousands of PWM.
        self.vx = FirmwarePid(Gains(25.0, 1.0, 0.0), DT)
        self.vy = FirmwarePid(Gains(25.0, 1.0, 0.0), DT)
        self.vz = FirmwarePid(
            Gains(25.0, 15.0, 0.0), DT, output_limit=FULL_PWM / 2.0 / _THRUST_SCALE
        )
        self.roll_limit = self.pitch_limit = 20.0  #: deg.
        self.vx_max = self.vy_max = self.vz_max = 1.0  #: m/s.
        #: thrust_base, thrust_min: Approximate thrust of hover, and least thrust (PWM). The
        #: integral of the climb controller adds the difference to the vehicle's hover.
        self.thrust_base = 36000
        self.thrust_min = 20000
        #: Estimate in the heading frame, for the log.
        self.body_x = self.body_y = self.body_vx = self.body_vy = 0.0

    def reset(self) -> None:
        """Reset integrals and last measurements."""
        for pid in (self.x, self.y, self.z, self.vx, self.vy, self.vz):
            pid.reset()

    def update(self, setpoint: Setpoint, estimate: Estimate) -> Triple:
        """Return roll (deg), pitch (deg, the firmware's sign) and thrust (PWM)."""
        back = -math.radians(estimate.yaw)
        self.body_x, self.body_y = rotate_by_yaw(estimate.x, estimate.y, back)
        self.body_vx, self.body_vy = rotate_by_yaw(estimate.vx, estimate.vy, back)
        x, y = rotate_by_yaw(setpoint.x, setpoint.y, back)
        vx, vy, vz = setpoint.vx, setpoint.vy, setpoint.vz
        if not setpoint.velocity_body:
            vx, vy = rotate_by_yaw(vx, vy, back)
        if setpoint.mode.x == ABSOLUTE:
            self.x.output_limit = self.vx_max * _OVERHEAD
            vx = self.x.update(x, self.body_x)
        if setpoint.mode.y == ABSOLUTE:
            self.y.output_limit = self.vy_max * _OVERHEAD
            vy = self.y.update(y, self.body_y)
        if setpoint.mode.z == ABSOLUTE:
            self.z.output_limit = max(self.vz_max, 0.5) * _OVERHEAD
            vz = self.z.update(setpoint.z, estimate.z)

        self.vx.output_limit = self.pitch_limit * _OVERHEAD
        self.vy.output_limit = self.roll_limit * _OVERHEAD
        pitch = -self.vx.update(vx, self.body_vx)
        roll = -self.vy.update(vy, self.body_vy)
        thrust = self.thrust_base + _THRUST_SCALE * self.vz.update(vz, estimate.vz)
        return (
            constrain(roll, -self.roll_limit, self.roll_limit),
            constrain(pitch, -self.pitch_limit, self.pitch_limit),
            constrain(thrust, self.thrust_min, FULL_PWM),
        )
