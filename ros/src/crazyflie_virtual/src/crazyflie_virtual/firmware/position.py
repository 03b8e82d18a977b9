"""Position and velocity controllers, 100 Hz.

A cascade in the heading frame: errors of the position set a velocity, errors of
the velocity set roll, pitch and thrust. Structure and gains are those of the
Crazyflie 2.1's firmware (2024, controller PID).
"""

import math

from crazyflie_model.angles import Triple
from crazyflie_model.limits import FULL_PWM
from crazyflie_model.pid import Gains
from crazyflie_virtual.firmware.pid import FirmwarePid, constrain
from crazyflie_virtual.firmware.states import ABSOLUTE, Estimate, Setpoint

DT = 0.01  #: Time between two updates, s.
#: How much of a limit the integral may go beyond it, so that it can leave it again.
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
        #: thrust_base, thrust_min: PWM: what hovers, about, and the least that is given. What the
        #: first lacks to the vehicle's hover, the integral of the climb controller adds.
        self.thrust_base = 36000
        self.thrust_min = 20000
        #: Estimate in the heading frame, for the log.
        self.body_x = self.body_y = self.body_vx = self.body_vy = 0.0

    def reset(self) -> None:
        """Forget integrals and last measurements."""
        for pid in (self.x, self.y, self.z, self.vx, self.vy, self.vz):
            pid.reset()

    def update(self, setpoint: Setpoint, estimate: Estimate) -> Triple:
        """Return roll (deg), pitch (deg, the firmware's sign) and thrust (PWM)."""
        yaw = math.radians(estimate.yaw)
        c, s = math.cos(yaw), math.sin(yaw)
        self.body_x = estimate.x * c + estimate.y * s
        self.body_y = estimate.y * c - estimate.x * s
        self.body_vx = estimate.vx * c + estimate.vy * s
        self.body_vy = estimate.vy * c - estimate.vx * s

        vx, vy, vz = setpoint.vx, setpoint.vy, setpoint.vz
        if not setpoint.velocity_body:
            vx, vy = vx * c + vy * s, vy * c - vx * s
        if setpoint.mode.x == ABSOLUTE:
            self.x.output_limit = self.vx_max * _OVERHEAD
            vx = self.x.update(setpoint.x * c + setpoint.y * s, self.body_x)
        if setpoint.mode.y == ABSOLUTE:
            self.y.output_limit = self.vy_max * _OVERHEAD
            vy = self.y.update(setpoint.y * c - setpoint.x * s, self.body_y)
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
