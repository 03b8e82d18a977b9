"""Setpoint and estimate, in the firmware's units and signs.

Angles are in degrees, rates in degrees per second. The pitch of attitudes and of
setpoints is the firmware's: positive is nose up, so that a *negative* pitch
accelerates forward (+x). Quaternions and positions are those of the rest of the
workspace.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

from crazyflie_model.angles import Quaternion
from crazyflie_virtual.quaternions import compress_quaternion

#: Modes of a setpoint's axis: not controlled, to this value, at this rate.
DISABLED, ABSOLUTE, VELOCITY = 0, 1, 2
#: Position, velocity and acceleration of setpoint and estimate.
MOTION = ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az")


class Modes(NamedTuple):
    """Modes of a setpoint: `DISABLED`, `ABSOLUTE` or `VELOCITY` for each axis."""

    x: int = DISABLED
    y: int = DISABLED
    z: int = DISABLED
    roll: int = DISABLED
    pitch: int = DISABLED
    yaw: int = DISABLED
    quaternion: int = DISABLED


@dataclass(slots=True)
class _Motion:
    """Position, velocity, acceleration and attitude."""

    #: x, y, z, vx, vy, vz: m and m/s, fixed frame.
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    #: ax, ay, az: Without gravity, fixed frame; m/s^2 in a setpoint, g in an estimate.
    ax: float = 0.0
    ay: float = 0.0
    az: float = 0.0
    #: roll, pitch, yaw: deg, ``R = Rz(yaw) Ry(-pitch) Rx(roll)``.
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0


@dataclass(slots=True)
class Setpoint(_Motion):
    """A setpoint; with all axes disabled and no thrust, the motors are off."""

    mode: Modes = Modes()  #: Mode of the setpoint; controllers are reset when it changes.
    velocity_body: bool = False  #: Whether the velocity is turned by the heading.
    #: roll_rate, pitch_rate, yaw_rate: deg/s, positive yaw rate is counter-clockwise.
    roll_rate: float = 0.0
    pitch_rate: float = 0.0
    yaw_rate: float = 0.0
    quaternion: Quaternion = (0.0, 0.0, 0.0, 1.0)  #: (x, y, z, w).
    thrust: float = 0.0  #: PWM, used where z is disabled.
    time: float = 0.0  #: Time of reception (s).

    @property
    def is_finite(self) -> bool:
        """Whether all numbers are finite."""
        parts = (getattr(self, part.name) for part in fields(self))
        return all(math.isfinite(part) for part in parts if isinstance(part, float))

    def leveled(self) -> "Setpoint":
        """Return a level setpoint with the same heading and height."""
        mode = self.mode._replace(
            x=DISABLED, y=DISABLED, roll=ABSOLUTE, pitch=ABSOLUTE, yaw=VELOCITY
        )
        return replace(self, mode=mode, roll=0.0, pitch=0.0, yaw_rate=0.0)


@dataclass(slots=True)
class Estimate(_Motion):
    """The estimated state."""

    #: qx, qy, qz, qw: Body to fixed frame.
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    qw: float = 1.0

    @property
    def is_finite(self) -> bool:
        """Whether all numbers are finite: others propagate to position or attitude."""
        return math.isfinite(self.x + self.y + self.z + self.vx + self.vy + self.vz + self.qw)

    @property
    def quaternion(self) -> Quaternion:
        """(qx, qy, qz, qw)."""
        return (self.qx, self.qy, self.qz, self.qw)

    @property
    def compressed_quaternion(self) -> int:
        """The quaternion in 32 bits."""
        return compress_quaternion(self.quaternion)
