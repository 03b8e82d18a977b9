"""The full vehicle: airframe and inner loops behind the interface of all models."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from typing_extensions import override

from crazyflie_model import inner_loops
from crazyflie_model.angles import Quaternion, Triple, zyx_from_quaternion
from crazyflie_model.dynamics import STEP, Dynamics, rk4_step
from crazyflie_model.elementwise import Number, Vector, clip, functions, where
from crazyflie_model.quadrotor import CRAZYFLIE, QuadrotorParameters
from crazyflie_model.units import GRAVITY, pwm_from_thrust

BODY_DIM = 17  #: Components of the airframe's state.
STILL_AIR = (0.0, 0.0, 0.0)  #: No wind (m/s).

_LEAST_NORM = 1e-9  #: Least norm of the heading's part of an attitude.


class Airframe:
    """Equations of motion of a rigid body with four rotors.

    Thrust and torque of a rotor go with the square of its speed, drag with the
    airspeed and the speed of the rotors (chapter 3 of [F], see `QuadrotorParameters`). A
    rotor without command runs down; one that has failed is one that is commanded zero.

    Frames: fixed (z up) and body (forward-left-up). The rotors are numbered as in
    `inner_loops.mix`.

    State, 17 components: position (3) in m and velocity (3) in m/s in the fixed
    frame, attitude quaternion (x, y, z, w) from body to fixed frame, body rates (3)
    in rad/s, rotor speeds (4) in rad/s. Input, 7 components: commanded rotor speeds
    (4) in rad/s, velocity of the air (3) in m/s in the fixed frame.

    ``lift_near(height)`` is the thrust at a height (m) over that far above the ground, such as
    `aerodynamics.ground_effect`; by default it is the same everywhere.
    """

    def __init__(
        self,
        parameters: QuadrotorParameters,
        lift_near: Callable[[Number], Number] | None = None,
    ):
        self.parameters = parameters
        self._lift_near: Callable[[Any], Any] | None = lift_near

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
        _, _, z, vx, vy, vz, qx, qy, qz, qw, p, q, r, w1, w2, w3, w4 = x
        c1, c2, c3, c4, wind_x, wind_y, wind_z = u
        thrust, torque_x, torque_y, torque_z = self.wrench((w1, w2, w3, w4))
        if self._lift_near is not None:
            thrust = thrust * self._lift_near(z)

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


STEPS_PER_SAMPLE = round(inner_loops.PERIOD / STEP)  #: Steps between two of the inner loops.


def still_air(t: float) -> Triple:
    """Return the velocity of still air, m/s."""
    return STILL_AIR


class StabilizedQuadrotor(Dynamics):
    """A quadrotor that takes the control (roll, pitch, yaw_dot, thrust) to its motors.

    State: that of an `Airframe`, the memory of the inner loops (see `inner_loops`), and
    the four motor speeds commanded last, rad/s. The inner loops sample every second step; between
    samples the latter two stay.

    Thrust is normalised with the *nominal* mass and thrust constant, as is the radio link's: a true
    vehicle, which has more of both by ``mass_error`` and ``thrust_error`` (fractions of the nominal
    ones, > -1), hovers at ``GRAVITY * (1 + mass_error) / (1 + thrust_error)``. Roll and pitch are
    those in the heading frame. ``wind(t)`` is the velocity of the air (3 components) at time t (s),
    m/s, fixed frame; ``wake(position, thrust)`` the speed, m/s down, of the air that other vehicles
    move at the position (m) of this one, which has a thrust (N).
    """

    x_dim = BODY_DIM + inner_loops.MEMORY_DIM + 4

    def __init__(
        self,
        parameters: QuadrotorParameters = CRAZYFLIE,
        mass_error: float = 0.0,
        thrust_error: float = 0.0,
        wind: Callable[[float], Triple] = still_air,
        wake: Callable[[Any, Any], float] | None = None,
    ):
        self.airframe = Airframe(parameters.with_errors(mass_error, thrust_error))
        self._nominal = parameters
        # The default type uses the link's own conversion, which is the same and faster.
        self._pwm = pwm_from_thrust if parameters == CRAZYFLIE else parameters.pwm
        self._wind = wind
        self._wake = wake

    def initial_state(self, position: Sequence[Number]) -> Vector[Number]:
        """See `Dynamics.initial_state`; in the air the rotors carry the vehicle."""
        body = self.airframe.initial_state(position)
        return body + inner_loops.initial_memory(0.0) + body[-4:]

    def rates(self, t: float, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        """See `Dynamics.rates`: of continuous states; others are constant between samples."""
        body = self.airframe.rates(t, x[:BODY_DIM], x[-4:] + [*self._wind(t)])
        return body + [0.0] * (self.x_dim - BODY_DIM)

    def apply_ground_contact(self, x: Vector[Number]) -> Vector[Number]:
        """See `Dynamics.apply_ground_contact` and `Airframe.apply_ground_contact`."""
        return self.airframe.apply_ground_contact(x[:BODY_DIM]) + x[BODY_DIM:]

    @override
    def pose(self, x: Sequence[float], u: Sequence[float]) -> tuple[Triple, Quaternion]:
        return (x[0], x[1], x[2]), (x[6], x[7], x[8], x[9])

    @override
    def step(self, count: int, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        body, memory, commands = x[:BODY_DIM], x[BODY_DIM:-4], x[-4:]
        if count % STEPS_PER_SAMPLE == 0:
            memory, commands = self._sample(body, memory, u)
        t = count * STEP
        wind = self._wind(t)
        if self._wake is not None:
            thrust = self.airframe.wrench(body[13:17])[0]
            wind = wind[0], wind[1], wind[2] - self._wake((body[0], body[1], body[2]), thrust)
        body = self.airframe.step(t, body, commands, wind, STEP)
        return body + memory + commands

    def _sample(self, body, memory, u):
        attitude = zyx_from_quaternion(body[6:10])
        # A real vehicle rocks on its feet until its loops have settled. This one
        # is held upright, so its loops are reset: they would wind up.
        standing = body[2] <= 0.0
        resting = inner_loops.initial_memory(attitude[2])
        memory = [where(standing, a, b) for a, b in zip(resting, memory, strict=True)]
        setpoint = [where(standing, 0.0, part) for part in u[:3]] + [u[3]]
        memory, pwm = inner_loops.update(memory, setpoint, attitude, body[10:13], self._pwm)
        return memory, [self._nominal.rotor_speed(motor) for motor in pwm]
