"""Setpoints as they are on the wire."""

import math
import struct

from crazyflie_model.limits import MAX_SETPOINT_PWM
from crazyflie_virtual.firmware.commander import NOBODY
from crazyflie_virtual.firmware.compressed import decompress_quaternion
from crazyflie_virtual.firmware.states import ABSOLUTE, VELOCITY, Setpoint

_LEAST_THRUST = 1000
"""Of an attitude setpoint, PWM: less is none."""

_RATE_MODE = 0

_ATTITUDE = struct.Struct("<fffH")
_FOUR = struct.Struct("<ffff")
_FULL_STATE = struct.Struct("<9hI3h")
_MANUAL = struct.Struct("<fffHB")


class AttitudeDecoder:
    """Attitude setpoints, port 3, and their thrust lock.

    Thrust counts only after one setpoint without thrust has come.

    Attributes
    ----------
    roll_mode, pitch_mode, yaw_mode : int
        Whether roll and pitch are angles (1) or rates (0); the yaw rate is a
        rate always.
    is_locked : bool
    """

    def __init__(self):
        self.roll_mode = self.pitch_mode = 1
        self.yaw_mode = _RATE_MODE
        self.is_locked = True

    def decode(self, data: bytes, priority: int, time: float) -> Setpoint | None:
        """Return the setpoint; None when the packet is not one.

        Parameters
        ----------
        data : bytes
            Roll, pitch in deg or deg/s, yaw rate in deg/s, clockwise positive,
            thrust in PWM.
        priority : int
            Of the present setpoint: the lock closes where there is none.
        time : float
            s.
        """
        values = _unpack(_ATTITUDE, data)
        if values is None:
            return None
        roll, pitch, yaw_rate, thrust = values
        if priority == NOBODY:
            self.is_locked = True
        if thrust == 0:
            self.is_locked = False
        used = 0.0 if self.is_locked or thrust < _LEAST_THRUST else min(thrust, MAX_SETPOINT_PWM)
        setpoint = Setpoint(mode_yaw=VELOCITY, yaw_rate=-yaw_rate, thrust=float(used), time=time)
        _set_tilt(setpoint, "roll", roll, self.roll_mode == _RATE_MODE)
        _set_tilt(setpoint, "pitch", pitch, self.pitch_mode == _RATE_MODE)
        return setpoint


def decode_generic(data: bytes, time: float) -> Setpoint | None:
    """Return a generic setpoint, port 7; None when the packet is not one.

    Parameters
    ----------
    data : bytes
        Type and payload.
    time : float
        s.
    """
    decoder = _DECODERS.get(data[0]) if data else None
    setpoint = decoder(data[1:]) if decoder else None
    if setpoint is not None:
        setpoint.time = time
    return setpoint


def _unpack(form, data):
    # Like the firmware, take no notice of packets of another size; unlike it,
    # neither of numbers that are none, which no vehicle can follow.
    if len(data) != form.size:
        return None
    values = form.unpack(data)
    return values if all(map(math.isfinite, values)) else None


def _set_tilt(setpoint, axis, value, is_rate):
    setattr(setpoint, f"mode_{axis}", VELOCITY if is_rate else ABSOLUTE)
    setattr(setpoint, f"{axis}_rate" if is_rate else axis, value)


def _four(build, yaw_sign=1.0):
    def decode(data):
        values = _unpack(_FOUR, data)
        return None if values is None else build(*values, yaw_sign)

    return decode


def _stop(data):
    return Setpoint()


def _velocity_world(vx, vy, vz, yaw_rate, sign):
    return Setpoint(
        mode_x=VELOCITY,
        mode_y=VELOCITY,
        mode_z=VELOCITY,
        mode_yaw=VELOCITY,
        vx=vx,
        vy=vy,
        vz=vz,
        yaw_rate=sign * yaw_rate,
    )


def _z_distance(roll, pitch, yaw_rate, z, sign):
    return Setpoint(
        mode_z=ABSOLUTE,
        mode_roll=ABSOLUTE,
        mode_pitch=ABSOLUTE,
        mode_yaw=VELOCITY,
        roll=roll,
        pitch=pitch,
        yaw_rate=sign * yaw_rate,
        z=z,
    )


def _climb(roll, pitch, yaw_rate, vz, sign):
    return Setpoint(
        mode_z=VELOCITY,
        mode_roll=ABSOLUTE,
        mode_pitch=ABSOLUTE,
        mode_yaw=VELOCITY,
        roll=roll,
        pitch=pitch,
        yaw_rate=sign * yaw_rate,
        vz=vz,
    )


def _hover(vx, vy, yaw_rate, z, sign):
    return Setpoint(
        mode_x=VELOCITY,
        mode_y=VELOCITY,
        mode_z=ABSOLUTE,
        mode_yaw=VELOCITY,
        vx=vx,
        vy=vy,
        velocity_body=True,
        yaw_rate=sign * yaw_rate,
        z=z,
    )


def _position(x, y, z, yaw, sign):
    return Setpoint(
        mode_x=ABSOLUTE, mode_y=ABSOLUTE, mode_z=ABSOLUTE, mode_yaw=ABSOLUTE, x=x, y=y, z=z, yaw=yaw
    )


def _full_state(data):
    values = _unpack(_FULL_STATE, data)
    if values is None:
        return None
    x, y, z, vx, vy, vz, ax, ay, az, word, p, q, r = values
    rates = [math.degrees(rate / 1000.0) for rate in (p, q, r)]
    return Setpoint(
        mode_x=ABSOLUTE,
        mode_y=ABSOLUTE,
        mode_z=ABSOLUTE,
        mode_quaternion=ABSOLUTE,
        x=x / 1000.0,
        y=y / 1000.0,
        z=z / 1000.0,
        vx=vx / 1000.0,
        vy=vy / 1000.0,
        vz=vz / 1000.0,
        ax=ax / 1000.0,
        ay=ay / 1000.0,
        az=az / 1000.0,
        quaternion=decompress_quaternion(word),
        roll_rate=rates[0],
        pitch_rate=rates[1],
        yaw_rate=rates[2],
    )


def _manual(data):
    values = _unpack(_MANUAL, data)
    if values is None:
        return None
    roll, pitch, yaw_rate, thrust, is_rate = values
    setpoint = Setpoint(mode_yaw=VELOCITY, yaw_rate=yaw_rate, thrust=float(thrust))
    _set_tilt(setpoint, "roll", roll, bool(is_rate))
    _set_tilt(setpoint, "pitch", pitch, bool(is_rate))
    return setpoint


_DECODERS = {
    0: _stop,
    1: _four(_velocity_world, yaw_sign=-1.0),
    2: _four(_z_distance, yaw_sign=-1.0),
    4: _four(_climb),
    5: _four(_hover, yaw_sign=-1.0),
    6: _full_state,
    7: _four(_position),
    8: _four(_velocity_world),
    9: _four(_z_distance),
    10: _four(_hover),
    11: _manual,
}
"""Type -> decoder. 1, 2 and 5 are 8, 9 and 10 of older clients, with the yaw rate reversed."""
