"""The inner loops of the vehicle: attitude and rates, as in the firmware.

Cascaded PID controllers at 500 Hz. Structure and gains are those of the
Crazyflie 2.1's firmware (2022 to 2024, controller "PID"): a controller of the
attitude sets body rates, one of the rates sets the differences of the thrusts of
the four motors. A commanded yaw rate moves the heading setpoint.

The gains are in the firmware's degrees; `update` has angles in radians and,
unlike the firmware, positive pitch is nose down (accelerates forward).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from crazyflie_model.elementwise import Number, Vector, clip, functions, where
from crazyflie_model.limits import FULL_PWM
from crazyflie_model.units import pwm_from_thrust


@dataclass(frozen=True)
class Gains:
    """Gains of a PID controller whose derivative is that of the measurement."""

    #: kp, ki, kd: Output per error, per integral of the error, per rate of change of the
    #: measurement.
    kp: float
    ki: float
    kd: float
    #: Limit of the integral's magnitude, unit of the error times s. The default is the firmware's.
    limit: float = 5000.0


def terms(
    gains: Gains, error: Number, integral: Number, slope: Number, dt: float
) -> tuple[Number, Number, Number, Number]:
    """Return the proportional, integral and derivative part of the output, and the integral.

    ``error`` is the desired minus the measured value, ``integral`` the error's, as returned by the
    last update ``dt`` s ago, ``slope`` the rate of change of the measurement. ``gains`` may be any
    object with the attributes of `Gains`.
    """
    integral = clip(integral + error * dt, -gains.limit, gains.limit)
    return gains.kp * error, gains.ki * integral, -gains.kd * slope, integral


def mix(thrust: Number, about_x: Number, about_y: Number, about_z: Number) -> Vector[Number]:
    """Return the requests to motors 1 to 4, PWM, not limited.

    Arguments: the thrust of each motor, and the outputs of the rate controllers about forward, left
    and up, PWM.
    """
    x, y, z = about_x / 2.0, about_y / 2.0, about_z
    return [
        thrust - x - y - z,
        thrust - x + y + z,
        thrust + x + y - z,
        thrust + x - y + z,
    ]


def limit(requested: Sequence[Number], idle: float = 0.0) -> Vector[Number]:
    """Return commands from ``idle`` to `FULL_PWM` for four requested ones, PWM.

    Where one would exceed `FULL_PWM`, all are lowered alike: attitude comes before height.
    """
    highest = requested[0]
    for request in requested[1:]:
        highest = where(request > highest, request, highest)
    excess = clip(highest - FULL_PWM, 0.0, math.inf)
    return [clip(request - excess, idle, FULL_PWM) for request in requested]


PERIOD = 0.002  #: Time between two samples (s).
OUTPUT_LIMIT = 32767.0  #: Largest output of a rate controller, PWM: 16 bits in the firmware.
TILT = Gains(6.0, 3.0, 0.0, 20.0)  #: Roll and pitch, deg, to body rates, deg/s.
HEADING = Gains(6.0, 1.0, 0.35, 360.0)  #: Yaw, deg, to body rate, deg/s.
TILT_RATE = Gains(250.0, 500.0, 2.5, 33.3)  #: Rates about forward and left, deg/s, to PWM.
HEADING_RATE = Gains(120.0, 16.7, 0.0, 166.7)  #: Rate about up, deg/s, to PWM.

#: Length of the loops' memory: integrals of the attitude errors (3), of the rate errors (3), last
#: body rates about forward and left (2), heading setpoint.
MEMORY_DIM = 9

_DEGREE = math.pi / 180.0


def _from_rad_to_rad(gains):
    return replace(gains, limit=gains.limit * _DEGREE)


def _from_rad_to_pwm(gains):
    kp, ki, kd = (gain / _DEGREE for gain in (gains.kp, gains.ki, gains.kd))
    return Gains(kp, ki, kd, gains.limit * _DEGREE)


_TILT, _HEADING = map(_from_rad_to_rad, (TILT, HEADING))
_TILT_RATE, _HEADING_RATE = map(_from_rad_to_pwm, (TILT_RATE, HEADING_RATE))


def initial_memory(yaw: Number) -> Vector[Number]:
    """Return the memory of loops that begin at a heading ``yaw`` (rad), at rest."""
    return [0.0] * (MEMORY_DIM - 1) + [yaw]


def update(
    memory: Vector[Number],
    setpoint: Vector[Number],
    attitude: tuple[Number, Number, Number],
    rates: Vector[Number],
    pwm: Callable[[Number], Number] = pwm_from_thrust,
) -> tuple[Vector[Number], Vector[Number]]:
    """Return memory and motor commands (PWM, of motors 1 to 4) after one sample.

    Without thrust the motors are off and the loops are reset. ``memory`` is the one returned
    `PERIOD` ago; ``setpoint`` is roll and pitch in rad, yaw rate in rad/s, thrust in m/s^2;
    ``attitude`` is roll, pitch and yaw of `angles.zyx_from_quaternion`, rad; ``rates`` are the
    body's, rad/s; ``pwm(thrust)`` is the motor command for a thrust over the mass.
    """
    roll_i, pitch_i, yaw_i, p_i, q_i, r_i, p_before, q_before, heading = memory
    roll_set, pitch_set, yaw_dot_set, thrust = setpoint
    roll, pitch, yaw = attitude
    p, q, r = rates

    heading = heading + yaw_dot_set * PERIOD
    ahead = heading - yaw
    f = functions(ahead)
    yaw_error = f.atan2(f.sin(ahead), f.cos(ahead))

    p_set, roll_i = _output(_TILT, roll_set - roll, roll_i, p)
    q_set, pitch_i = _output(_TILT, pitch_set - pitch, pitch_i, q)
    r_set, yaw_i = _output(_HEADING, yaw_error, yaw_i, r)
    about_x, p_i = _output(_TILT_RATE, p_set - p, p_i, (p - p_before) / PERIOD)
    about_y, q_i = _output(_TILT_RATE, q_set - q, q_i, (q - q_before) / PERIOD)
    about_z, r_i = _output(_HEADING_RATE, r_set - r, r_i, 0.0)

    on = thrust > 0.0
    outputs = [clip(about, -OUTPUT_LIMIT, OUTPUT_LIMIT) for about in (about_x, about_y, about_z)]
    motors = limit(mix(pwm(thrust), *outputs))
    commands = [where(on, motor, 0.0) for motor in motors]
    running = [roll_i, pitch_i, yaw_i, p_i, q_i, r_i, p, q, heading]
    reset = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, p, q, yaw]
    return [where(on, a, b) for a, b in zip(running, reset, strict=True)], commands


def _output(gains, error, integral, slope):
    p, i, d, integral = terms(gains, error, integral, slope, PERIOD)
    return p + i + d, integral
