"""The figures of a quadrotor: mass, rotors, drag, lags and limits, of types of Crazyflies."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

from crazyflie_model.elementwise import Number, clip, functions
from crazyflie_model.limits import (
    FULL_PWM,
    MAX_SETPOINT_PWM,
    MAX_THRUST,
    MAX_TILT,
    MAX_YAW_RATE,
)
from crazyflie_model.units import GRAVITY, HOVER_PWM


@dataclass(frozen=True)
class QuadrotorParameters:
    """Figures of a vehicle; the defaults are those of the Crazyflie 2.1.

    Sources:

    [L] C. Luis and J. Le Ny, Design of a trajectory tracking controller for a
    nanoquadcopter, 2016, arXiv:1608.05786 (thrust there per rpm^2).
    [F] J. Förster, System identification of the Crazyflie 2.0 nano
    quadrocopter, bachelor thesis, ETH Zurich, 2015.
    [B] Bitcraze, Crazyflie 2.1 data sheet, and the firmware's constants, which
    agree with [F] in the torque of a rotor. [L] has four times as much.
    """

    mass: float = 0.027  #: Mass with battery, kg [B, L].
    #: inertia_x, inertia_y, inertia_z: Principal moments about forward, left and up, kg m^2 [L].
    inertia_x: float = 1.395e-5
    inertia_y: float = 1.436e-5
    inertia_z: float = 2.173e-5
    arm: float = 0.046  #: Distance from centre to rotor axis (m): half of motor to motor [B].
    #: Thrust of a rotor over its speed squared, N s^2 [L].
    thrust_constant: float = 3.1582e-10 * (30.0 / math.pi) ** 2
    torque_per_thrust: float = 0.005964552  #: Torque of a rotor over its thrust, m [F].
    #: drag_horizontal, drag_vertical: Drag over airspeed over the sum of the rotor speeds, across
    #: and along the rotors' axes, kg [F].
    drag_horizontal: float = 9.1785e-7
    drag_vertical: float = 10.311e-7
    #: Lag (first order) between commanded and true speed, s [F: discrete pole at 0.9695404
    #: with 500 Hz].
    motor_time_constant: float = -0.002 / math.log(0.9695404)
    #: Largest rotor speed, rad/s [L, at full PWM].
    max_rotor_speed: float = (0.2685 * FULL_PWM + 4070.3) * math.pi / 30.0
    #: thrust_linear, thrust_quadratic: Thrust of a rotor over the command as a fraction f of full
    #: PWM, thrust_linear f + thrust_quadratic f^2, N. `HOVER_PWM` carries the default mass.
    thrust_linear: float = 0.027 * GRAVITY / 4.0 * FULL_PWM / HOVER_PWM
    thrust_quadratic: float = 0.0
    delay: float = 0.0  #: Time from the arrival of a command at the driver to the motion (s).
    #: roll_lag, pitch_lag, yaw_lag: First-order lag of roll, pitch and yaw rate behind their
    #: commands, s; None: the lag follows from the inner loops.
    roll_lag: float | None = None
    pitch_lag: float | None = None
    yaw_lag: float | None = None
    #: roll_trim, pitch_trim: Angles that are added to a command so that the vehicle does not drift,
    #: rad.
    roll_trim: float = 0.0
    pitch_trim: float = 0.0
    #: tilt_limit, yaw_rate_limit, thrust_limit: Largest roll and pitch (rad), yaw rate (rad/s) and
    #: thrust over the mass (m/s^2) that are commanded.
    tilt_limit: float = MAX_TILT
    yaw_rate_limit: float = MAX_YAW_RATE
    thrust_limit: float = MAX_THRUST

    @cached_property
    def hover_speed(self) -> float:
        """Speed of all four rotors at which they carry the vehicle, rad/s."""
        squared = self.mass * GRAVITY / (4.0 * self.thrust_constant)
        return functions(squared).sqrt(squared)

    def thrust(self, pwm: Number) -> Number:
        """Return the thrust of all rotors over the mass (m/s^2) for a motor command (PWM)."""
        return self._force(pwm / FULL_PWM) * (4.0 / self.mass)

    def pwm(self, thrust: Number) -> Number:
        """Return the motor command (PWM) for a thrust over the mass (m/s^2).

        Below 0 it is linear, and not limited.
        """
        a, b, force = self.thrust_linear, self.thrust_quadratic, thrust * (self.mass / 4.0)
        # A form of the root of b f^2 + a f = force that is also valid for b = 0. With b < 0 and a
        # force that the curve does not reach, the command is beyond the curve's highest point.
        square = a * a + 4.0 * b * clip(force, 0.0, math.inf)
        root = functions(force).sqrt(clip(square, 0.0, math.inf))
        return 2.0 * force / (a + root) * FULL_PWM

    @property
    def max_thrust(self) -> float:
        """Largest thrust over the mass that an attitude setpoint can ask for, m/s^2."""
        return self.thrust(MAX_SETPOINT_PWM)

    def rotor_speed(self, pwm: Number) -> Number:
        """Return the speed (rad/s) that a motor command (PWM, from 0 on) asks for."""
        return functions(pwm).sqrt(self._force(pwm / FULL_PWM) / self.thrust_constant)

    def _force(self, fraction):
        return (self.thrust_linear + self.thrust_quadratic * fraction) * fraction

    @cached_property
    def drag_rates(self) -> tuple[float, float]:
        """Deceleration over airspeed in hover, horizontally and vertically, 1/s."""
        scale = 4.0 * self.hover_speed / self.mass
        return self.drag_horizontal * scale, self.drag_vertical * scale

    def with_errors(self, mass_error: float, thrust_error: float) -> "QuadrotorParameters":
        """Return a vehicle with more mass and thrust constant, as fractions > -1 of these."""
        return replace(
            self,
            mass=self.mass * (1.0 + mass_error),
            thrust_constant=self.thrust_constant * (1.0 + thrust_error),
        )

    def with_thrust_curve(self, linear: float, quadratic: float) -> "QuadrotorParameters":
        """Return a vehicle with a thrust curve, whose top speed is that of a full command."""
        model = replace(self, thrust_linear=linear, thrust_quadratic=quadratic)
        return replace(model, max_rotor_speed=model.rotor_speed(FULL_PWM))


CRAZYFLIE = QuadrotorParameters()  #: The Crazyflie 2.1.

#: Types of vehicles by name. Where Bitcraze publishes no figure, it is that of `CRAZYFLIE`.
#: Sources, of crazyflie-firmware (2025): [P] platform_defaults_cf2.h (of the 2.1+ propellers) and
#: platform_defaults_cf21bl.h, whose firmware makes the thrust linear in the command, up to
#: THRUST_MAX; [D] pwmToThrustA and B of power_distribution_quadrotor.c.
TYPES = {
    "cf21": CRAZYFLIE,
    # With markers and battery 33 g, which the curve of [D] carries at `HOVER_PWM`.
    "cf21_markers": replace(CRAZYFLIE, mass=0.033).with_thrust_curve(0.067673604, 0.091492681),
    "cf21plus": replace(CRAZYFLIE, mass=0.029).with_thrust_curve(0.1125, 0.0),
    "brushless": replace(
        CRAZYFLIE, mass=0.0393, arm=0.050, torque_per_thrust=0.00569278844371417
    ).with_thrust_curve(0.2, 0.0),
}
