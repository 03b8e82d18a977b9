"""The inner loops of the vehicle: attitude and rates, as the firmware has them.

Cascaded PID controllers at 500 Hz. Structure and gains are those of the
Crazyflie 2.1's firmware (2022, controller "PID"): a controller of the attitude
sets body rates, one of the rates sets what is added to and subtracted from the
thrust of the four motors. A commanded yaw rate moves the heading that is held.
Unlike the firmware, angles are in radians and positive pitch is nose down
(accelerates forward).
"""

import math
from dataclasses import dataclass

from crazyflie_simulator.elementwise import clip, functions, where
from crazyflie_utils.units import pwm_from_thrust

PERIOD = 0.002
"""Time between two samples, s."""

FULL_PWM = 65535.0
"""Largest command of a motor."""

MEMORY_DIM = 9
"""What the loops remember: integrals of the attitude errors (3), of the rate
errors (3), last body rates about forward and left (2), heading that is held."""

_DEGREE = math.pi / 180.0
_MAX_OUTPUT = 32767.0
"""The firmware's rate controllers have outputs of 16 bits, PWM."""


@dataclass(frozen=True)
class Pid:
    """Gains of a PID controller whose derivative is that of the measurement.

    Attributes
    ----------
    kp, ki, kd : float
        Output per error, per integral, per rate of change of the measurement.
    limit : float
        Of the integral's magnitude, unit of the error times s.
    """

    kp: float
    ki: float
    kd: float
    limit: float

    def update(self, error, integral, slope) -> tuple:
        """Return output and integral, given the measurement's rate of change."""
        integral = clip(integral + error * PERIOD, -self.limit, self.limit)
        return self.kp * error + self.ki * integral - self.kd * slope, integral


TILT = Pid(6.0, 3.0, 0.0, 20.0 * _DEGREE)
"""Roll and pitch, rad, to body rates, rad/s."""

HEADING = Pid(6.0, 1.0, 0.35, 360.0 * _DEGREE)
"""Yaw, rad, to body rate, rad/s."""

TILT_RATE = Pid(250.0 / _DEGREE, 500.0 / _DEGREE, 2.5 / _DEGREE, 33.3 * _DEGREE)
"""Rates about forward and left, rad/s, to PWM."""

HEADING_RATE = Pid(120.0 / _DEGREE, 16.7 / _DEGREE, 0.0, 166.7 * _DEGREE)
"""Rate about up, rad/s, to PWM."""


def initial_memory(yaw) -> list:
    """Return the memory of loops that begin at a heading ``yaw`` (rad), at rest."""
    return [0.0] * (MEMORY_DIM - 1) + [yaw]


def update(memory: list, setpoint: list, attitude: tuple, rates: list) -> tuple:
    """Return memory and motor commands after one sample.

    Without thrust the motors are off and the loops begin anew.

    Parameters
    ----------
    memory : list, 9 components
        What was returned `PERIOD` ago.
    setpoint : list, 4 components
        Roll, pitch in rad, yaw rate in rad/s, thrust in m/s^2.
    attitude : tuple, 3 components
        Roll, pitch, yaw of `quadrotor.euler_angles`, rad.
    rates : list, 3 components
        Body rates, rad/s.

    Returns
    -------
    tuple of list
        Memory, 9 components, and the commands of motors 1 to 4, PWM.
    """
    roll_i, pitch_i, yaw_i, p_i, q_i, r_i, p_before, q_before, heading = memory
    roll_set, pitch_set, yaw_dot_set, thrust = setpoint
    roll, pitch, yaw = attitude
    p, q, r = rates

    heading = heading + yaw_dot_set * PERIOD
    ahead = heading - yaw
    f = functions(ahead)
    yaw_error = f.atan2(f.sin(ahead), f.cos(ahead))

    p_set, roll_i = TILT.update(roll_set - roll, roll_i, p)
    q_set, pitch_i = TILT.update(pitch_set - pitch, pitch_i, q)
    r_set, yaw_i = HEADING.update(yaw_error, yaw_i, r)
    about_x, p_i = TILT_RATE.update(p_set - p, p_i, (p - p_before) / PERIOD)
    about_y, q_i = TILT_RATE.update(q_set - q, q_i, (q - q_before) / PERIOD)
    about_z, r_i = HEADING_RATE.update(r_set - r, r_i, 0.0)

    on = thrust > 0.0
    commands = [where(on, command, 0.0) for command in mix(thrust, about_x, about_y, about_z)]
    running = [roll_i, pitch_i, yaw_i, p_i, q_i, r_i, p, q, heading]
    reset = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, p, q, yaw]
    return [where(on, a, b) for a, b in zip(running, reset, strict=True)], commands


def mix(thrust, about_x, about_y, about_z) -> list:
    """Return the commands (PWM) of motors 1 to 4.

    Where one would exceed `FULL_PWM`, all are lowered alike: attitude comes
    before height.

    Parameters
    ----------
    thrust : float or ndarray
        m/s^2.
    about_x, about_y, about_z : float or ndarray
        Outputs of the rate controllers, PWM.
    """
    base = pwm_from_thrust(thrust)
    x = clip(about_x, -_MAX_OUTPUT, _MAX_OUTPUT) / 2.0
    y = clip(about_y, -_MAX_OUTPUT, _MAX_OUTPUT) / 2.0
    z = clip(about_z, -_MAX_OUTPUT, _MAX_OUTPUT)
    commands = [base - x - y - z, base - x + y + z, base + x + y - z, base + x - y + z]
    highest = commands[0]
    for command in commands[1:]:
        highest = where(command > highest, command, highest)
    excess = clip(highest - FULL_PWM, 0.0, math.inf)
    return [clip(command - excess, 0.0, FULL_PWM) for command in commands]
