"""Port 8: the high-level commander."""

import errno
import struct
from collections.abc import Callable

from crazyflie_virtual.firmware.commander import PRIORITY_CRTP
from crazyflie_virtual.firmware.firmware import Firmware

_ALL_GROUPS = 0


def handle(firmware: Firmware, channel: int, data: bytes) -> bytes | None:
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
    values = struct.unpack_from("<" + form, data)
    if command in _FOR_ALL:
        return handler(f, *values)
    if command in _PLANS and f.planner.blocked:
        f.warn("planner", f"HLC: refuses command {command}: {f.supervisor.state.value}")
        return errno.EBUSY
    if command in _PLANS and f.commander.priority == PRIORITY_CRTP:
        f.warn("planner", f"HLC: command {command} has no effect before setpoints stop")
    group, *arguments = values
    is_meant = group == _ALL_GROUPS or group & f.planner.groups
    return handler(f, *arguments) if is_meant else 0


def _set_groups(f, groups):
    f.planner.groups = groups
    return 0


def _take_off(f, height, yaw, keep_yaw, duration):
    return f.planner.take_off(f.time, height, None if keep_yaw else yaw, duration)


def _land(f, height, yaw, keep_yaw, duration):
    return f.planner.land(f.time, height, None if keep_yaw else yaw, duration)


def _take_off_at_speed(f, height, relative, yaw, keep_yaw, speed):
    speed = speed if speed > 0.0 else f.planner.takeoff_speed
    height, duration = f.planner.climb_time(height, relative, speed)
    return _take_off(f, height, yaw, keep_yaw, duration)


def _land_at_speed(f, height, relative, yaw, keep_yaw, speed):
    speed = speed if speed > 0.0 else f.planner.landing_speed
    height = -height if relative else height
    height, duration = f.planner.climb_time(height, relative, speed)
    return _land(f, height, yaw, keep_yaw, duration)


def _go_to(f, relative, linear, x, y, z, yaw, duration):
    return f.planner.go_to(f.time, (x, y, z), yaw, duration, relative, linear)


def _spiral(f, sideways, clockwise, angle, first, last, ascent, duration):
    radii = (first, last)
    return f.planner.spiral(f.time, angle, radii, ascent, duration, sideways, clockwise)


def _start(f, relative, relative_yaw, backwards, trajectory_id, time_scale):
    reason = f.planner.unflyable(trajectory_id)
    if reason:
        f.console.write_line(f"HLC: no trajectory {trajectory_id}: {reason}")
    elif not time_scale > 0.0:
        f.console.write_line(f"HLC: at its end at once: time scale {time_scale:g}")
    return f.planner.start(f.time, trajectory_id, time_scale, backwards, relative, relative_yaw)


#: Command -> (fields, handler). 1, 2, 4 and 5 are those of older clients.
_COMMANDS: dict[int, tuple[str, Callable[..., int]]] = {
    0: ("B", _set_groups),
    1: ("Bff", lambda f, height, duration: _take_off(f, height, 0.0, False, duration)),
    2: ("Bff", lambda f, height, duration: _land(f, height, 0.0, False, duration)),
    3: ("B", lambda f: f.planner.stop()),
    4: ("B?5f", lambda f, relative, *goal: _go_to(f, relative, False, *goal)),
    5: ("B??Bf", lambda f, relative, *trajectory: _start(f, relative, False, *trajectory)),
    6: ("3BIB", lambda f, *definition: f.planner.define(*definition)),
    7: ("Bff?f", _take_off),
    8: ("Bff?f", _land),
    9: ("Bf?f?f", _take_off_at_speed),
    10: ("Bf?f?f", _land_at_speed),
    11: ("B??5f", _spiral),
    12: ("B??5f", _go_to),
    13: ("B???Bf", _start),
}

#: Commands that are refused while the vehicle cannot fly, for any group.
_PLANS = tuple(command for command in _COMMANDS if command not in (0, 3, 6))
_FOR_ALL = (0, 6)  #: Commands that do not begin with the group of vehicles that they are for.
