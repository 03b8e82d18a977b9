"""Mellinger's controller, 500 Hz: the firmware's ``stabilizer.controller`` 2.

The desired force is mass times acceleration plus a PID of the position; its direction and the
heading are the desired attitude, whose error, as a rotation matrix, sets the torques. From
D. Mellinger, V. Kumar: Minimum snap trajectory generation and control for quadrotors, ICRA 2011,
with the integrals, the derivative of the body rates and the gains of the firmware (2026).

Angles are in rad here, axes are forward, left and up: positive pitch is nose down.
"""

import math

from crazyflie_model.angles import (
    Quaternion,
    Triple,
    product,
    quaternion_from_zyx,
    rotate,
    rotate_by_yaw,
    zyx_from_quaternion,
)
from crazyflie_model.inner_loops import PERIOD
from crazyflie_model.units import GRAVITY
from crazyflie_virtual.body import Sensors
from crazyflie_virtual.firmware.controllers import constrain
from crazyflie_virtual.firmware.states import ABSOLUTE, DISABLED, VELOCITY, Estimate, Setpoint

TORQUE_LIMIT = 32000.0  #: Largest output about an axis, PWM.


class MellingerController:
    """Controller from a setpoint and the estimate to the inputs of the mixer."""

    def __init__(self) -> None:
        #: Mass (kg), and motor command per force (PWM/N).
        self.mass, self.mass_thrust = 0.027, 132000.0
        #: Gains of the position (N/m, N/(m s), N s/m), and limits of its integrals (m s).
        self.kp_xy, self.ki_xy, self.kd_xy, self.i_range_xy = 0.4, 0.05, 0.2, 2.0
        self.kp_z, self.ki_z, self.kd_z, self.i_range_z = 1.25, 1.5, 0.4, 0.4
        #: Gains of attitude, body rates and integral of the attitude (PWM per rad, rad/s, rad s),
        #: limits of these integrals (rad s), gain of the body accelerations (PWM per rad/s^2).
        self.kR_xy, self.kw_xy, self.ki_m_xy, self.i_range_m_xy = 70000.0, 20000.0, 0.0, 1.0
        self.kR_z, self.kw_z, self.ki_m_z, self.i_range_m_z = 60000.0, 12000.0, 500.0, 1500.0
        self.kd_omega_rp = 200.0
        self.attitude: Triple = (0.0, 0.0, 0.0)  #: Desired roll, pitch (nose up) and yaw (deg).
        self._last_slip: Triple | None = None
        self.reset()

    def reset(self) -> None:
        """Reset the integrals."""
        self._position_integral = self._attitude_integral = (0.0, 0.0, 0.0)

    def update(self, setpoint: Setpoint, estimate: Estimate, sensors: Sensors) -> tuple[float, ...]:
        """Return the thrust and the outputs about forward, left and up, PWM."""
        force = self._force(setpoint, estimate)
        mode, yaw = setpoint.mode, math.radians(estimate.yaw)
        is_manual = mode.z == DISABLED and mode.roll == mode.pitch == ABSOLUTE
        if mode.x == ABSOLUTE or is_manual:
            yaw = _heading(setpoint, estimate)
        if mode.x != ABSOLUTE and is_manual:
            roll, pitch = math.radians(setpoint.roll), -math.radians(setpoint.pitch)
            desired = quaternion_from_zyx(roll, pitch, yaw)
        else:
            desired = _attitude_along(force, yaw)
        roll, pitch, yaw = zyx_from_quaternion(desired)
        self.attitude = math.degrees(roll), -math.degrees(pitch), math.degrees(yaw)
        # The error is that of rotation matrices, equation (10) of the paper without the half, from
        # the rotation from the desired attitude to the estimated one.
        a, b, c, d = desired
        x, y, z, w = product((-a, -b, -c, d), estimate.quaternion)
        error = 4.0 * w * x, 4.0 * w * y, 4.0 * w * z
        outputs = self._torques(error, setpoint, sensors)
        thrust = setpoint.thrust
        if mode.z != DISABLED:
            up = rotate(estimate.quaternion, (0.0, 0.0, 1.0))
            thrust = self.mass_thrust * (force[0] * up[0] + force[1] * up[1] + force[2] * up[2])
        if not thrust > 0.0:
            self.reset()
            return (0.0,) * 4
        return (thrust, *outputs)

    def _force(self, setpoint: Setpoint, estimate: Estimate) -> Triple:
        # N, fixed frame. A setpoint without a position only holds its height.
        place = (setpoint.x - estimate.x, setpoint.y - estimate.y, setpoint.z - estimate.z)
        motion = (setpoint.vx - estimate.vx, setpoint.vy - estimate.vy, setpoint.vz - estimate.vz)
        limits = (self.i_range_xy, self.i_range_xy, self.i_range_z)
        self._position_integral = _integrated(self._position_integral, place, limits)
        kp = (self.kp_xy, self.kp_xy, self.kp_z)
        ki = (self.ki_xy, self.ki_xy, self.ki_z)
        kd = (self.kd_xy, self.kd_xy, self.kd_z)
        x, y, z = (
            p * a + d * b + i * c
            for p, a, d, b, i, c in zip(
                kp, place, kd, motion, ki, self._position_integral, strict=True
            )
        )
        if setpoint.mode.x != ABSOLUTE:
            return 0.0, 0.0, self.mass * GRAVITY + z
        mass = self.mass
        return (
            mass * setpoint.ax + x,
            mass * setpoint.ay + y,
            mass * (setpoint.az + GRAVITY) + z,
        )

    def _torques(self, error: Triple, setpoint: Setpoint, sensors: Sensors) -> tuple[float, ...]:
        # PWM, about forward, left and up.
        rates = (setpoint.roll_rate, setpoint.pitch_rate, setpoint.yaw_rate)
        gyro = (sensors.gyro_x, sensors.gyro_y, sensors.gyro_z)
        p, q, r = (math.radians(a - b) for a, b in zip(rates, gyro, strict=True))
        slip = (p, q, r)
        last, self._last_slip = self._last_slip or slip, slip
        limits = (self.i_range_m_xy, self.i_range_m_xy, self.i_range_m_z)
        against = (-error[0], -error[1], -error[2])
        self._attitude_integral = _integrated(self._attitude_integral, against, limits)
        gains = (
            (self.kR_xy, self.kw_xy, self.ki_m_xy, self.kd_omega_rp),
            (self.kR_xy, self.kw_xy, self.ki_m_xy, self.kd_omega_rp),
            (self.kR_z, self.kw_z, self.ki_m_z, 0.0),
        )
        outputs = (
            k_r * against[i]
            + k_w * slip[i]
            + k_i * self._attitude_integral[i]
            + k_d * (slip[i] - last[i]) / PERIOD
            for i, (k_r, k_w, k_i, k_d) in enumerate(gains)
        )
        return tuple(constrain(output, -TORQUE_LIMIT, TORQUE_LIMIT) for output in outputs)


def _heading(setpoint: Setpoint, estimate: Estimate) -> float:
    # rad.
    if setpoint.mode.yaw == VELOCITY:
        return math.radians(estimate.yaw + setpoint.yaw_rate * PERIOD)
    if setpoint.mode.yaw == ABSOLUTE:
        return math.radians(setpoint.yaw)
    if setpoint.mode.quaternion == ABSOLUTE:
        return zyx_from_quaternion(setpoint.quaternion)[2]
    return 0.0


def _attitude_along(force: Triple, yaw: float) -> Quaternion:
    # The up axis is along the force; the forward axis is as near to the heading as that permits.
    if not any(force):
        # No attitude is wrong: this is none, with which all angles and errors are zero.
        return 0.0, 0.0, 0.0, 0.0
    # The direction of an infinite force is NaN, which is limited as with the firmware.
    length = math.hypot(*force)
    x, y, z = (component / length for component in force)
    x, y = rotate_by_yaw(x, y, -yaw)
    roll, pitch = math.atan2(-y, z), math.atan2(x, math.hypot(y, z))
    # The pitch is about the left axis that the roll has tilted.
    tilt = (0.0, math.sin(pitch / 2.0), 0.0, math.cos(pitch / 2.0))
    return product(quaternion_from_zyx(roll, 0.0, yaw), tilt)


def _integrated(integral: Triple, error: Triple, limits: Triple) -> Triple:
    x, y, z = (
        constrain(i + e * PERIOD, -limit, limit)
        for i, e, limit in zip(integral, error, limits, strict=True)
    )
    return x, y, z
