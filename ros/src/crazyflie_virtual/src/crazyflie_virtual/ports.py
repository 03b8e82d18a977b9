"""The firmware's smaller ports.

Link, setpoints, supervisor, platform, localization and high-level commands.
"""

import errno
import math
import struct
from collections.abc import Callable

from crazyflie_virtual.crtp import MAX_DATA, Port
from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.firmware.planner import Planner
from crazyflie_virtual.firmware.setpoints import PRIORITY_CRTP, decode_generic
from crazyflie_virtual.quaternions import decompress_quaternion

_ECHO, _SOURCE, _SINK = 0, 1, 2

_IDENTITY = b"Bitcraze Crazyflie"


def handle_link(firmware: Firmware, channel: int, data: bytes) -> bytes | None:
    """Return the data of the answer; None for no answer."""
    if channel == _ECHO:
        return data
    if channel == _SOURCE:
        return _IDENTITY.ljust(MAX_DATA, b"\0")
    if channel != _SINK:
        firmware.warn("link", f"LINK: unknown channel {channel}")
    return None


_SETPOINT, _META = 0, 1
_SETPOINTS_STOP = b"\0"


def handle_attitude(firmware: Firmware, channel: int, data: bytes) -> None:
    """Process an attitude setpoint; there is no answer."""
    f = firmware
    if channel != _SETPOINT:
        f.warn("setpoint", f"CMD: unknown channel {channel}")
    elif setpoint := f.attitude_decoder.decode(data, f.commander.priority, f.time):
        f.stream(setpoint)
        if f.attitude_decoder.is_locked:
            f.warn("thrust", "CMD: thrust is locked until a setpoint without thrust comes")
    else:
        f.warn("setpoint", "CMD: an attitude setpoint of less than 14 bytes")


def handle_generic(firmware: Firmware, channel: int, data: bytes) -> None:
    """Process a setpoint of another type or the end of streaming; there is no answer."""
    f = firmware
    if channel == _SETPOINT:
        if setpoint := decode_generic(data, f.time):
            f.stream(setpoint)
        else:
            f.warn("setpoint", f"CMD: unknown type of setpoint {data[:1].hex()}")
    elif channel == _META and data[:1] == _SETPOINTS_STOP:
        f.commander.relax_priority(f.estimate)
    else:
        f.warn("setpoint", f"CMD: unknown command {channel}/{data[:1].hex()}")


_SUPERVISOR_INFO, _SUPERVISOR_COMMAND = 0, 1
_FIRST_BIT, _ALL_BITS = 0x01, 0x0C
_ARM, _RECOVER, _EMERGENCY_STOP, _EMERGENCY_WATCHDOG = 1, 2, 3, 4
_RESPONSE = 0x80


def handle_supervisor(firmware: Firmware, channel: int, data: bytes) -> bytes | None:
    """Return the data of the answer; None for no answer."""
    if not data:
        return None
    command = data[0]
    answer: bytes | None = None
    if channel == _SUPERVISOR_INFO and _FIRST_BIT <= command < _ALL_BITS:
        answer = bytes([firmware.info >> (command - _FIRST_BIT) & 1])
    elif channel == _SUPERVISOR_INFO and command == _ALL_BITS:
        answer = struct.pack("<H", firmware.info)
    elif channel == _SUPERVISOR_COMMAND and _ARM <= command <= _EMERGENCY_WATCHDOG:
        answer = _command_supervisor(firmware, command, data[1:])
    else:
        firmware.warn("supervisor", f"SUP: unknown command {channel}/{command}")
    return None if answer is None else bytes([_RESPONSE | command]) + answer


def _command_supervisor(firmware: Firmware, command: int, data: bytes) -> bytes | None:
    """Execute a command; return the data of the answer, None for no answer.

    The answer to `_ARM` and `_RECOVER` is two bytes: done, and armed or recovered.
    """
    supervisor = firmware.supervisor
    if command == _ARM:
        # Without its byte the firmware reads that of an earlier packet: nothing changes.
        done = supervisor.arm(bool(data[0]) if data else supervisor.is_armed)
        return bytes([done, supervisor.is_armed])
    if command == _RECOVER:
        done = supervisor.recover()
        return bytes([done, not supervisor.is_crashed])
    if command == _EMERGENCY_STOP:
        supervisor.stop()
    elif command == _EMERGENCY_WATCHDOG:
        supervisor.feed_watchdog(firmware.time)
    return None


_PLATFORM_COMMAND, _VERSION = 0, 1
_CONTINUOUS_WAVE, _NOTIFY = 0, 3
_PROTOCOL, _FIRMWARE, _DEVICE = 0, 1, 2

#: The firmware is the release whose behaviour is imitated.
_NAMES = {_FIRMWARE: b"2026.08 virtual", _DEVICE: b"Crazyflie 2.1"}


def handle_platform(firmware: Firmware, channel: int, data: bytes) -> bytes | None:
    """Return the data of the answer; None for no answer."""
    if not data:
        return None
    command, rest = data[0], data[1:]
    answer = None
    if channel == _VERSION and command == _PROTOCOL:
        answer = struct.pack("<i", firmware.protocol)
    elif channel == _VERSION and command in _NAMES:
        answer = _NAMES[command]
    elif channel == _VERSION:
        firmware.warn("platform", f"PLATFORM: unknown version {command}")
    elif channel == _PLATFORM_COMMAND and command in (_ARM, _RECOVER):
        answer = _command_supervisor(firmware, command, rest)
    elif channel == _PLATFORM_COMMAND and command in (_CONTINUOUS_WAVE, _NOTIFY):
        answer = rest
    else:
        firmware.warn("platform", f"PLATFORM: unknown command {channel}/{command}")
    return None if answer is None else bytes([command]) + answer


_POSITION, GENERIC, _PACKED_POSITIONS = 0, 1, 2  #: Channels of localization.
_STOP_MESSAGE, _WATCHDOG_MESSAGE, _POSE, _PACKED_POSES = 3, 4, 8, 9
_STORE_LIGHTHOUSE = 11

_PACKED_POSITION = struct.Struct("<B3h")
_PACKED_POSE = struct.Struct("<B3hI")


def handle_localization(firmware: Firmware, channel: int, data: bytes) -> bytes | None:
    """Process an external measurement; only the storing of lighthouse data is answered."""
    f = firmware
    command = data[0] if channel == GENERIC and data else None
    if channel == _POSITION and len(data) == 12:
        _take(f, struct.unpack("<fff", data))
    elif channel == _PACKED_POSITIONS:
        for values in _own(_PACKED_POSITION, data, f.address):
            _take(f, [part / 1000.0 for part in values])
    elif command == _POSE and len(data) == 29:
        values = struct.unpack("<7f", data[1:])
        _take(f, values[:3], values[3:])
    elif command == _PACKED_POSES:
        for *position, word in _own(_PACKED_POSE, data[1:], f.address):
            _take(f, [part / 1000.0 for part in position], decompress_quaternion(word))
    elif command == _STOP_MESSAGE:
        f.supervisor.stop()
    elif command == _WATCHDOG_MESSAGE:
        f.supervisor.feed_watchdog(f.time)
    elif command == _STORE_LIGHTHOUSE and len(data) == 5:
        done = f.deck.memory.store(*struct.unpack_from("<HH", data, 1))
        return bytes([_STORE_LIGHTHOUSE, done])
    elif command is not None:
        f.warn("location", f"LOC: ignoring a message {command}")
    else:
        f.warn("location", f"LOC: nothing done with {len(data)} bytes on channel {channel}")
    return None


def _take(f, position, quaternion=None):
    norm = 1.0 if quaternion is None else math.hypot(*quaternion)
    # Not a rotation, or not a number.
    if not (all(map(math.isfinite, position)) and 0.5 < norm < 2.0):
        f.warn("location", "LOC: a measurement that is not a number, or not a rotation")
    elif quaternion is None:
        f.localization.take_position(f.time, position)
    else:
        f.localization.take_pose(f.time, position, tuple(part / norm for part in quaternion))


def _own(form, data, address):
    # Packed measurements of several vehicles: those that are marked with an address.
    for mark, *values in form.iter_unpack(data[: len(data) // form.size * form.size]):
        if mark == address:
            yield values


_ALL_GROUPS = 0


def handle_high_level(firmware: Firmware, channel: int, data: bytes) -> bytes | None:
    """Return the answer to a command: four bytes, the last an error number."""
    if not data:
        return None
    return data[:3].ljust(3, b"\0") + bytes([_execute(firmware, data[0], data[1:])])


def _execute(f, command, data):
    if command not in _COMMANDS:
        f.warn("command", f"HLC: unknown command {command}")
        return errno.ENOEXEC
    form, handler = _COMMANDS[command]
    if len(data) < struct.calcsize("<" + form):
        f.warn("command", f"HLC: command {command} is too short")
        return errno.EINVAL
    values = list(struct.unpack_from("<" + form, data))
    if command in _PLANS and f.planner.blocked:
        f.warn("planner", f"HLC: refused command {command}: {f.supervisor.state.value}")
        return errno.EBUSY
    if command in _PLANS and f.commander.priority == PRIORITY_CRTP:
        f.warn("planner", f"HLC: command {command} has no effect before setpoints stop")
    if command not in _FOR_ALL:
        group = values.pop(0)
        if group != _ALL_GROUPS and not group & f.planner.groups:
            return 0
    return handler(f.planner, f.time, *values)


#: Command -> (fields, handler). 1, 2, 4 and 5 are those of older clients.
_COMMANDS: dict[int, tuple[str, Callable[..., int]]] = {
    0: ("B", lambda planner, _, groups: planner.set_groups(groups)),
    1: ("Bff", lambda planner, t, height, time: planner.take_off(t, height, 0.0, False, time)),
    2: ("Bff", lambda planner, t, height, time: planner.land(t, height, 0.0, False, time)),
    3: ("B", lambda planner, _: planner.stop()),
    4: ("B?5f", lambda planner, t, relative, *goal: planner.go_to(t, relative, False, *goal)),
    5: ("B??Bf", lambda planner, t, relative, *rest: planner.start(t, relative, False, *rest)),
    6: ("3BIB", lambda planner, _, *definition: planner.define(*definition)),
    7: ("Bff?f", Planner.take_off),
    8: ("Bff?f", Planner.land),
    9: ("Bf?f?f", Planner.take_off_at_speed),
    10: ("Bf?f?f", Planner.land_at_speed),
    11: ("B??5f", Planner.spiral),
    12: ("B??5f", Planner.go_to),
    13: ("B???Bf", Planner.start),
}

#: Commands that are refused while the vehicle cannot fly, for any group.
_PLANS = tuple(command for command in _COMMANDS if command not in (0, 3, 6))
_FOR_ALL = (0, 6)  #: Commands that do not begin with a group of vehicles.

#: Port -> handler, called with firmware, channel and data; it returns the data of the answer, or
#: None. Ports with a state have classes of their own.
HANDLERS: dict[int, Callable[[Firmware, int, bytes], bytes | None]] = {
    Port.LINK: handle_link,
    Port.PLATFORM: handle_platform,
    Port.SETPOINT: handle_attitude,
    Port.GENERIC_SETPOINT: handle_generic,
    Port.HIGH_LEVEL: handle_high_level,
    Port.LOCALIZATION: handle_localization,
    Port.SUPERVISOR: handle_supervisor,
}
