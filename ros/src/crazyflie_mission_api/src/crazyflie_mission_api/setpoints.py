"""Low-level setpoints of a vehicle, each of which is sent once."""

import math
from dataclasses import dataclass

from crazyflie_model.angles import Triple

#: Age of a setpoint at which the firmware levels out, s (commander.h, WDT_TIMEOUT_STABILIZE).
SETPOINT_TIMEOUT = 0.5


@dataclass(frozen=True)
class FullStateSetpoint:
    """Position (m), velocity (m/s), acceleration (m/s^2), yaw (rad), body rates (rad/s)."""

    position: Triple
    velocity: Triple
    acceleration: Triple
    yaw: float
    omega: Triple


@dataclass(frozen=True)
class PositionSetpoint:
    """Position (m) and yaw (rad)."""

    position: Triple
    yaw: float


@dataclass(frozen=True)
class VelocityWorldSetpoint:
    """Velocity in the world frame (m/s) and yaw rate (deg/s, counter-clockwise)."""

    velocity: Triple
    yaw_rate: float


@dataclass(frozen=True)
class HoverSetpoint:
    """Velocity forward and to the left (m/s), yaw rate (deg/s, counter-clockwise), height (m)."""

    vx: float
    vy: float
    yaw_rate: float
    height: float

    def velocity(self, yaw: float) -> tuple[float, float]:
        """Return the velocity along x and y of the world, m/s, at a yaw (rad)."""
        c, s = math.cos(yaw), math.sin(yaw)
        return c * self.vx - s * self.vy, s * self.vx + c * self.vy


@dataclass(frozen=True)
class AttitudeSetpoint:
    """Roll right, pitch forward (deg), yaw rate (deg/s, counter-clockwise), thrust (PWM)."""

    roll: float
    pitch: float
    yaw_rate: float
    thrust: float


@dataclass(frozen=True)
class MotorsOffSetpoint:
    """Stops the motors; a later setpoint or command starts them again."""


Setpoint = (
    FullStateSetpoint
    | PositionSetpoint
    | VelocityWorldSetpoint
    | HoverSetpoint
    | AttitudeSetpoint
    | MotorsOffSetpoint
)


def led_to(setpoint: Setpoint, place: Triple, yaw: float, duration: float) -> Triple | None:
    """Return where a setpoint leads a vehicle from a place (m) and yaw (rad) in a duration (s).

    None where that is not known.
    """
    x, y, z = place
    if isinstance(setpoint, FullStateSetpoint | PositionSetpoint):
        return setpoint.position
    if isinstance(setpoint, VelocityWorldSetpoint):
        vx, vy, vz = setpoint.velocity
        return x + vx * duration, y + vy * duration, z + vz * duration
    if isinstance(setpoint, HoverSetpoint):
        vx, vy = setpoint.velocity(yaw)
        return x + vx * duration, y + vy * duration, setpoint.height
    return None
