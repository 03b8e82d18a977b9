"""Low-level setpoints: what the cmd... methods of a Crazyflie send, once each."""

from dataclasses import dataclass

from crazyflie_model.angles import Triple


@dataclass(frozen=True)
class FullState:
    """Position (m), velocity (m/s), acceleration (m/s^2), yaw (rad), body rates (rad/s)."""

    position: Triple
    velocity: Triple
    acceleration: Triple
    yaw: float
    omega: Triple


@dataclass(frozen=True)
class Position:
    """Position (m) and yaw (rad)."""

    position: Triple
    yaw: float


@dataclass(frozen=True)
class VelocityWorld:
    """Velocity in the world frame (m/s) and yaw rate (deg/s, counter-clockwise)."""

    velocity: Triple
    yaw_rate: float


@dataclass(frozen=True)
class Hover:
    """Velocity forward and to the left (m/s), yaw rate (deg/s, counter-clockwise), height (m)."""

    vx: float
    vy: float
    yaw_rate: float
    height: float


@dataclass(frozen=True)
class Attitude:
    """Roll right, pitch forward (deg), yaw rate (deg/s, counter-clockwise), thrust (PWM)."""

    roll: float
    pitch: float
    yaw_rate: float
    thrust: float


@dataclass(frozen=True)
class MotorsOff:
    """Stops the motors; a later setpoint or command starts them again."""


Setpoint = FullState | Position | VelocityWorld | Hover | Attitude | MotorsOff
