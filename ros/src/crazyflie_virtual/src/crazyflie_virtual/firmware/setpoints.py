"""Setpoints as they are on the wire, and their priority over the high-level commander."""

import math
import struct
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from crazyflie_model.limits import MAX_SETPOINT_PWM
from crazyflie_virtual.crtp import FirmwareAssertionError
from crazyflie_virtual.firmware.planner import Planner
from crazyflie_virtual.firmware.states import ABSOLUTE, MOTION, VELOCITY, Estimate, Modes, Setpoint
from crazyflie_virtual.quaternions import decompress_quaternion

_LEAST_THRUST = 1000  #: Thrust of an attitude setpoint below which the motors are off (PWM).

_RATE_MODE = 0

_ATTITUDE = struct.Struct("<fffH")
_FOUR = struct.Struct("<ffff")
_FULL_STATE = struct.Struct("<9hI3h")
_MANUAL = struct.Struct("<fffHB")


class AttitudeDecoder:
    """Attitude setpoints, port 3, and their thrust lock.

    Thrust is enabled only after one setpoint without thrust has come.
    """

    def __init__(self) -> None:
        #: roll_mode, pitch_mode, yaw_mode: Whether roll and pitch are angles (1) or rates (0); the
        #: yaw rate is a rate always.
        self.roll_mode = self.pitch_mode = 1
        self.yaw_mode = _RATE_MODE
        self.is_locked = True

    def decode(self, data: bytes, priority: int, time: float) -> Setpoint | None:
        """Return the setpoint; None when the packet is not one.

        The packet has roll and pitch in deg or deg/s, yaw rate in deg/s, clockwise positive, and
        thrust in PWM. ``priority`` is that of the present setpoint: without one, the lock closes.
        """
        # The firmware does not check the size, and would read bytes of an earlier packet behind a
        # short one.
        if len(data) < _ATTITUDE.size:
            return None
        roll, pitch, yaw_rate, thrust = _ATTITUDE.unpack_from(data)
        if priority == PRIORITY_DISABLE:
            self.is_locked = True
        if thrust == 0:
            self.is_locked = False
        used = 0.0 if self.is_locked or thrust < _LEAST_THRUST else min(thrust, MAX_SETPOINT_PWM)
        setpoint = Setpoint(
            mode=Modes(yaw=VELOCITY), yaw_rate=-yaw_rate, thrust=float(used), time=time
        )
        return _with_tilt(
            setpoint, roll, self.roll_mode == _RATE_MODE, pitch, self.pitch_mode == _RATE_MODE
        )


def decode_generic(data: bytes, time: float) -> Setpoint | None:
    """Return a generic setpoint, port 7, from type and payload; None for an unknown type.

    `FirmwareAssertionError`: the payload has a wrong size.
    """
    decoder = _DECODERS.get(data[0]) if data else None
    if decoder is None:
        return None
    try:
        setpoint = decoder(data[1:])
    except struct.error:
        raise FirmwareAssertionError(
            f"a setpoint of type {data[0]} with {len(data) - 1} bytes"
        ) from None
    setpoint.time = time
    return setpoint


def _with_tilt(setpoint, roll, roll_is_rate, pitch, pitch_is_rate):
    # Each of roll and pitch is an angle or a rate.
    mode = setpoint.mode._replace(
        roll=VELOCITY if roll_is_rate else ABSOLUTE, pitch=VELOCITY if pitch_is_rate else ABSOLUTE
    )
    values = {
        "roll_rate" if roll_is_rate else "roll": roll,
        "pitch_rate" if pitch_is_rate else "pitch": pitch,
    }
    return replace(setpoint, mode=mode, **values)


class _FourFloats(NamedTuple):
    """A type of setpoint whose payload is four floats."""

    fields: tuple[str, str, str, str]  #: Names of the setpoint's fields that the floats set.
    mode: Modes
    velocity_body: bool = False

    def decode(self, data: bytes) -> Setpoint:
        """Return the setpoint in a payload."""
        values = zip(self.fields, _FOUR.unpack(data), strict=True)
        setpoint = Setpoint(mode=self.mode, velocity_body=self.velocity_body)
        return replace(setpoint, **dict(values))

    def decode_any_size(self, data: bytes) -> Setpoint:
        """Return the setpoint in a payload whose size the firmware does not check.

        Missing bytes are 0 here; in the firmware they are those of an earlier packet.
        """
        return self.decode(data[: _FOUR.size].ljust(_FOUR.size, b"\0"))

    def decode_clockwise(self, data: bytes) -> Setpoint:
        """Return the setpoint in a payload of an older client, whose yaw rate is clockwise."""
        setpoint = self.decode(data)
        return replace(setpoint, yaw_rate=-setpoint.yaw_rate)


_VELOCITY_WORLD = _FourFloats(
    ("vx", "vy", "vz", "yaw_rate"), Modes(x=VELOCITY, y=VELOCITY, z=VELOCITY, yaw=VELOCITY)
)
_Z_DISTANCE = _FourFloats(
    ("roll", "pitch", "yaw_rate", "z"),
    Modes(z=ABSOLUTE, roll=ABSOLUTE, pitch=ABSOLUTE, yaw=VELOCITY),
)
_VERTICAL_SPEED = _FourFloats(
    ("roll", "pitch", "yaw_rate", "vz"),
    Modes(z=VELOCITY, roll=ABSOLUTE, pitch=ABSOLUTE, yaw=VELOCITY),
)
_HOVER = _FourFloats(
    ("vx", "vy", "yaw_rate", "z"),
    Modes(x=VELOCITY, y=VELOCITY, z=ABSOLUTE, yaw=VELOCITY),
    velocity_body=True,
)
_POSITION = _FourFloats(
    ("x", "y", "z", "yaw"), Modes(x=ABSOLUTE, y=ABSOLUTE, z=ABSOLUTE, yaw=ABSOLUTE)
)


def _stop(data):
    return Setpoint()


def _full_state(data):
    *motion, word, p, q, r = _FULL_STATE.unpack(data)
    # mm and milliradians on the wire.
    return Setpoint(
        **{name: part / 1000.0 for name, part in zip(MOTION, motion, strict=True)},
        mode=Modes(x=ABSOLUTE, y=ABSOLUTE, z=ABSOLUTE, quaternion=ABSOLUTE),
        quaternion=decompress_quaternion(word),
        roll_rate=math.degrees(p / 1000.0),
        pitch_rate=math.degrees(q / 1000.0),
        yaw_rate=math.degrees(r / 1000.0),
    )


def _manual(data):
    roll, pitch, yaw_rate, thrust, is_rate = _MANUAL.unpack(data)
    setpoint = Setpoint(mode=Modes(yaw=VELOCITY), yaw_rate=yaw_rate, thrust=float(thrust))
    return _with_tilt(setpoint, roll, bool(is_rate), pitch, bool(is_rate))


#: Type -> decoder. 1, 2 and 5 are 8, 9 and 10 of older clients.
_DECODERS: dict[int, Callable[[bytes], Setpoint]] = {
    0: _stop,
    1: _VELOCITY_WORLD.decode_clockwise,
    2: _Z_DISTANCE.decode_clockwise,
    4: _VERTICAL_SPEED.decode,
    5: _HOVER.decode_clockwise,
    6: _full_state,
    7: _POSITION.decode_any_size,
    8: _VELOCITY_WORLD.decode,
    9: _Z_DISTANCE.decode,
    10: _HOVER.decode,
    11: _manual,
}


#: Priorities, named as in the firmware.
PRIORITY_DISABLE, PRIORITY_HIGHLEVEL, PRIORITY_CRTP = 0, 1, 2


class Commander:
    """The setpoint with the highest priority.

    A streamed setpoint stops the high-level commander and overrides it until
    `relax_priority`: neither age nor a new client ends that. Afterwards the high-level
    commander holds the motors off until its next command.
    """

    def __init__(self, planner: Planner):
        self._planner = planner
        self.setpoint = Setpoint()
        #: `PRIORITY_DISABLE`, `PRIORITY_HIGHLEVEL` or `PRIORITY_CRTP`.
        self.priority = PRIORITY_DISABLE
        #: Parameter without effect, as in the firmware: the commander is always enabled.
        self.high_level_enabled = 1

    def stream(self, setpoint: Setpoint) -> None:
        """Process a setpoint of the client."""
        self.setpoint = setpoint
        self.priority = PRIORITY_CRTP
        self._planner.stop()

    def relax_priority(self, estimate: Estimate) -> None:
        """Permit high-level setpoints, beginning at the estimated state."""
        self.priority = min(self.priority, PRIORITY_HIGHLEVEL)
        self._planner.tell_state(estimate)

    def update_from_planner(self, time: float, estimate: Estimate) -> None:
        """Use the high-level commander's setpoint for ``time`` (s)."""
        setpoint = self._planner.setpoint(time, estimate)
        if setpoint is not None and self.priority <= PRIORITY_HIGHLEVEL:
            self.setpoint = setpoint
            self.priority = PRIORITY_HIGHLEVEL

    def age(self, time: float) -> float:
        """Return the age of the setpoint at ``time``, s."""
        return time - self.setpoint.time
