"""The airframe of a quadrotor: a rigid body with four rotors, without any control.

Frames: fixed (z up) and body (forward-left-up). The rotors are numbered as in
`mixer`.

State, 17 components: position (3) in m and velocity (3) in m/s in the fixed
frame, attitude quaternion (x, y, z, w) from body to fixed frame, body rates (3)
in rad/s, rotor speeds (4) in rad/s. Input, 7 components: commanded rotor speeds
(4) in rad/s, velocity of the air (3) in m/s in the fixed frame.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from crazyflie_model.angles import Triple
from crazyflie_model.dynamics import rk4_step
from crazyflie_model.elementwise import Number, Vector, clip, functions, where
from crazyflie_model.limits import (
    FULL_PWM,
    MAX_SETPOINT_PWM,
    MAX_THRUST,
    MAX_TILT,
    MAX_YAW_RATE,
)
from crazyflie_model.units import GRAVITY, HOVER_PWM

BODY_DIM = 17  #: Components of the airframe's state.
STILL_AIR = (0.0, 0.0, 0.0)  #: No wind (m/s).

_LEAST_NORM = 1e-9  #: Least norm of the heading's part of an attitude.


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
        # A form of the root of b f^2 + a f = force that is also valid for b = 0.
        root = functions(force).sqrt(a * a + 4.0 * b * clip(force, 0.0, math.inf))
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


CRAZYFLIE = QuadrotorParameters()  #: The Crazyflie 2.1.


def _with_top(curve: tuple[float, float], **figures: float) -> QuadrotorParameters:
    """Return a type whose rotors reach the speed that a full command asks for."""
    parameters = replace(CRAZYFLIE, thrust_linear=curve[0], thrust_quadratic=curve[1], **figures)
    return replace(parameters, max_rotor_speed=parameters.rotor_speed(FULL_PWM))


#: Types of vehicles by name. Where Bitcraze publishes no figure, it is that of `CRAZYFLIE`.
#: Sources, of crazyflie-firmware (2025): [P] platform_defaults_cf2.h (of the 2.1+ propellers) and
#: platform_defaults_cf21bl.h, whose firmware makes the thrust linear in the command, up to
#: THRUST_MAX; [D] pwmToThrustA and B of power_distribution_quadrotor.c.
TYPES = {
    "cf21": CRAZYFLIE,
    # With markers and battery 33 g, which the curve of [D] carries at `HOVER_PWM`.
    "cf21_markers": _with_top((0.067673604, 0.091492681), mass=0.033),
    "cf21plus": _with_top((0.1125, 0.0), mass=0.029),
    "brushless": _with_top(
        (0.2, 0.0), mass=0.0393, arm=0.050, torque_per_thrust=0.00569278844371417
    ),
}


class Airframe:
    """Equations of motion of a rigid body with four rotors.

    Thrust and torque of a rotor go with the square of its speed, drag with the
    airspeed and the speed of the rotors [F, chapter 3]. A rotor without command
    runs down; one that has failed is one that is commanded zero.
    """

    def __init__(self, parameters: QuadrotorParameters):
        self.parameters = parameters

    def initial_state(self, position: Sequence[Number]) -> Vector[Number]:
        """Return the state at rest and level, heading along x.

        On the ground the rotors stand still; in the air they carry the vehicle.
        """
        x, y, z = position
        speed = where(z > 0.0, self.parameters.hover_speed, 0.0)
        return [x, y, z] + [0.0] * 6 + [1.0] + [0.0] * 3 + [speed] * 4

    def wrench(self, rotor_speeds: Sequence[Number]) -> tuple[Number, Number, Number, Number]:
        """Return thrust (N) and torque about forward, left and up (N m) of the rotors."""
        parameters = self.parameters
        w1, w2, w3, w4 = rotor_speeds
        k = parameters.thrust_constant
        f1, f2, f3, f4 = k * w1 * w1, k * w2 * w2, k * w3 * w3, k * w4 * w4
        lever = parameters.arm * math.sqrt(0.5)
        return (
            f1 + f2 + f3 + f4,
            lever * (f3 + f4 - f1 - f2),
            lever * (f2 + f3 - f1 - f4),
            parameters.torque_per_thrust * (f2 + f4 - f1 - f3),
        )

    def rates(self, t: float, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        """Return the time derivative of the state; see the module for x and u."""
        parameters = self.parameters
        _, _, _, vx, vy, vz, qx, qy, qz, qw, p, q, r, w1, w2, w3, w4 = x
        c1, c2, c3, c4, wind_x, wind_y, wind_z = u
        thrust, torque_x, torque_y, torque_z = self.wrench((w1, w2, w3, w4))

        # The body's up axis in the fixed frame, third column of R(q).
        up_x, up_y = 2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx)
        up_z = 1.0 - 2.0 * (qx * qx + qy * qy)
        air_x, air_y, air_z = vx - wind_x, vy - wind_y, vz - wind_z
        # Drag is the same in all directions across the rotors, so that R(q) is
        # not needed: all of it with the horizontal constant, the rest along up.
        speeds = w1 + w2 + w3 + w4
        drag = parameters.drag_horizontal * speeds / parameters.mass
        extra = (parameters.drag_vertical - parameters.drag_horizontal) * speeds
        climb = air_x * up_x + air_y * up_y + air_z * up_z
        lift = (thrust - extra * climb) / parameters.mass

        ix, iy, iz = parameters.inertia_x, parameters.inertia_y, parameters.inertia_z
        lag = 1.0 / parameters.motor_time_constant
        return [
            vx,
            vy,
            vz,
            lift * up_x - drag * air_x,
            lift * up_y - drag * air_y,
            lift * up_z - drag * air_z - GRAVITY,
            0.5 * (qw * p + qy * r - qz * q),
            0.5 * (qw * q + qz * p - qx * r),
            0.5 * (qw * r + qx * q - qy * p),
            -0.5 * (qx * p + qy * q + qz * r),
            (torque_x - (iz - iy) * q * r) / ix,
            (torque_y - (ix - iz) * r * p) / iy,
            (torque_z - (iy - ix) * p * q) / iz,
            lag * (c1 - w1),
            lag * (c2 - w2),
            lag * (c3 - w3),
            lag * (c4 - w4),
        ]

    def step(
        self, t: float, x: Vector[Number], rotor_speeds: Vector[Number], wind: Triple, dt: float
    ) -> Vector[Number]:
        """Return the state (17 components) ``dt`` s later, with the quaternion of norm 1.

        The vehicle stays on or above the ground. ``t`` is the time at the beginning, s;
        ``rotor_speeds`` are commanded, rad/s, and limited to what the motors can do; ``wind`` is
        the velocity of the air in the fixed frame, m/s.
        """
        top = self.parameters.max_rotor_speed
        commands: Vector[Number] = [clip(speed, 0.0, top) for speed in rotor_speeds]
        x = rk4_step(self.rates, t, x, commands + [*wind], dt)
        qx, qy, qz, qw = x[6:10]
        norm = functions(qx).sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
        x[6:10] = qx / norm, qy / norm, qz / norm, qw / norm
        return self.apply_ground_contact(x)

    def apply_ground_contact(self, x: Vector[Number]) -> Vector[Number]:
        """Return the state after contact with the ground, z = 0.

        A vehicle on the ground is upright and at rest, with its heading and an upward
        speed kept; its rotors may turn.
        """
        on_ground = x[2] <= 0.0
        if on_ground is False:
            return x
        qz, qw = x[8], x[9]
        norm = functions(qz).hypot(qz, qw)
        # Upside down, the heading is undefined; the squares of tiny numbers underflow.
        lost = norm < _LEAST_NORM
        norm = where(lost, 1.0, norm)
        upright: Vector[Number] = [
            0.0,
            0.0,
            where(lost, 0.0, qz / norm),
            where(lost, 1.0, qw / norm),
        ]
        climb = where(x[5] > 0.0, x[5], 0.0)
        standing = [x[0], x[1], 0.0, 0.0, 0.0, climb] + upright + [0.0] * 3 + x[13:]
        return [where(on_ground, after, before) for after, before in zip(standing, x, strict=True)]
