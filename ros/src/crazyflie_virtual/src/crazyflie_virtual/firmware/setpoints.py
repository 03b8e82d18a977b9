"""Setpoints as they are on the wire, and their priority over the high-level commander."""

import math
import struct
from collections.abc import Callable

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
        tilt = _tilt(roll, self.roll_mode == _RATE_MODE, pitch, self.pitch_mode == _RATE_MODE)
        return Setpoint(**tilt, yaw_rate=-yaw_rate, thrust=float(used), time=time)


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


def _tilt(roll, roll_is_rate, pitch, pitch_is_rate):
    # Fields of a setpoint whose roll and pitch are each an angle or a rate, the yaw is a rate.
    return {
        "mode": Modes(
            roll=VELOCITY if roll_is_rate else ABSOLUTE,
            pitch=VELOCITY if pitch_is_rate else ABSOLUTE,
            yaw=VELOCITY,
        ),
        "roll_rate" if roll_is_rate else "roll": roll,
        "pitch_rate" if pitch_is_rate else "pitch": pitch,
    }


def _four_floats(
    *fields: str, in_body: bool = False, is_clockwise: bool = False, any_size: bool = False
) -> Callable[[bytes], Setpoint]:
    """Return the decoder of a payload of four floats, which set these fields of the setpoint.

    Velocities may be in the body's heading. The yaw rate of older clients is clockwise. Where the
    firmware does not check the size, missing bytes are 0 here; in the firmware they are those of
    an earlier packet.
    """
    axes = {name.removeprefix("v").removesuffix("_rate"): name for name in fields}
    mode = Modes(**{axis: ABSOLUTE if axis == name else VELOCITY for axis, name in axes.items()})

    def decode(data: bytes) -> Setpoint:
        if any_size:
            data = data[: _FOUR.size].ljust(_FOUR.size, b"\0")
        values = dict(zip(fields, _FOUR.unpack(data), strict=True))
        if is_clockwise:
            values["yaw_rate"] = -values["yaw_rate"]
        return Setpoint(**values, mode=mode, velocity_body=in_body)

    return decode


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
    tilt = _tilt(roll, bool(is_rate), pitch, bool(is_rate))
    return Setpoint(**tilt, yaw_rate=yaw_rate, thrust=float(thrust))


_VELOCITY_WORLD = ("vx", "vy", "vz", "yaw_rate")
_Z_DISTANCE = ("roll", "pitch", "yaw_rate", "z")
_HOVER = ("vx", "vy", "yaw_rate", "z")

#: Type -> decoder. 1, 2 and 5 are 8, 9 and 10 of older clients.
_DECODERS: dict[int, Callable[[bytes], Setpoint]] = {
    0: _stop,
    1: _four_floats(*_VELOCITY_WORLD, is_clockwise=True),
    2: _four_floats(*_Z_DISTANCE, is_clockwise=True),
    4: _four_floats("roll", "pitch", "yaw_rate", "vz"),
    5: _four_floats(*_HOVER, in_body=True, is_clockwise=True),
    6: _full_state,
    7: _four_floats("x", "y", "z", "yaw", any_size=True),
    8: _four_floats(*_VELOCITY_WORLD),
    9: _four_floats(*_Z_DISTANCE),
    10: _four_floats(*_HOVER, in_body=True),
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
