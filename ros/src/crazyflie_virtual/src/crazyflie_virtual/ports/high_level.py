"""Port 8: the high-level commander."""

import errno
import struct
from collections.abc import Callable

from crazyflie_virtual.firmware.commander import PRIORITY_CRTP
from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.link.crtp import Packet, Port

_ALL_GROUPS = 0


class HighLevelPort:
    """Commands to the planner.

    Parameters
    ----------
    firmware : Firmware
    """

    port = Port.HIGH_LEVEL

    def __init__(self, firmware: Firmware):
        self._firmware = firmware
        self._planner = firmware.planner

    def handle(self, packet: Packet) -> list[Packet]:
        """Return the answer to a command: four bytes, the last an error number."""
        if not packet.data:
            return []
        error = self._command(packet.data[0], packet.data[1:])
        answer = packet.data[:3].ljust(3, b"\0") + bytes([error])
        return [Packet(Port.HIGH_LEVEL, packet.channel, answer)]

    def _command(self, command, data):
        f = self._firmware
        if command not in _COMMANDS:
            f.warn("command", f"HLC: unknown command {command}")
            return errno.ENOEXEC
        form, handler = _COMMANDS[command]
        if len(data) < struct.calcsize("<" + form):
            f.warn("command", f"HLC: command {command} is too short")
            return errno.EINVAL
        values = struct.unpack_from("<" + form, data)
        if command in _FOR_ALL:
            return handler(self, *values)
        if command in _PLANS and self._planner.blocked:
            f.warn("planner", f"HLC: refuses command {command}: {f.supervisor.state.value}")
            return errno.EBUSY
        if command in _PLANS and f.commander.priority == PRIORITY_CRTP:
            f.warn("planner", f"HLC: command {command} has no effect before setpoints stop")
        group, *arguments = values
        is_meant = group == _ALL_GROUPS or group & self._planner.groups
        return handler(self, *arguments) if is_meant else 0

    @property
    def _time(self):
        return self._firmware.time

    def _set_groups(self, groups):
        self._planner.groups = groups
        return 0

    def _stop(self):
        return self._planner.stop()

    def _take_off(self, height, yaw, keep_yaw, duration):
        return self._planner.take_off(self._time, height, None if keep_yaw else yaw, duration)

    def _land(self, height, yaw, keep_yaw, duration):
        return self._planner.land(self._time, height, None if keep_yaw else yaw, duration)

    def _take_off_1(self, height, duration):
        return self._take_off(height, 0.0, False, duration)

    def _land_1(self, height, duration):
        return self._land(height, 0.0, False, duration)

    def _take_off_at_speed(self, height, relative, yaw, keep_yaw, speed):
        speed = speed if speed > 0.0 else self._planner.takeoff_speed
        height, duration = self._planner.climb_time(height, relative, speed)
        return self._take_off(height, yaw, keep_yaw, duration)

    def _land_at_speed(self, height, relative, yaw, keep_yaw, speed):
        speed = speed if speed > 0.0 else self._planner.landing_speed
        height = -height if relative else height
        height, duration = self._planner.climb_time(height, relative, speed)
        return self._land(height, yaw, keep_yaw, duration)

    def _go_to(self, relative, linear, x, y, z, yaw, duration):
        return self._planner.go_to(self._time, (x, y, z), yaw, duration, relative, linear)

    def _go_to_1(self, relative, x, y, z, yaw, duration):
        return self._go_to(relative, False, x, y, z, yaw, duration)

    def _spiral(self, sideways, clockwise, angle, first, last, ascent, duration):
        return self._planner.spiral(
            self._time, angle, (first, last), ascent, duration, sideways, clockwise
        )

    def _start(self, relative, relative_yaw, backwards, trajectory_id, time_scale):
        reason = self._planner.unflyable(trajectory_id)
        if reason:
            self._firmware.console.write_line(f"HLC: no trajectory {trajectory_id}: {reason}")
        elif not time_scale > 0.0:
            self._firmware.console.write_line(f"HLC: at its end at once: time scale {time_scale:g}")
        return self._planner.start(
            self._time, trajectory_id, time_scale, backwards, relative, relative_yaw
        )

    def _start_1(self, relative, backwards, trajectory_id, time_scale):
        return self._start(relative, False, backwards, trajectory_id, time_scale)

    def _define(self, trajectory_id, location, kind, offset, pieces):
        return self._planner.define(trajectory_id, location, kind, offset, pieces)


_COMMANDS: dict[int, tuple[str, Callable[..., int]]] = {
    0: ("B", HighLevelPort._set_groups),
    1: ("Bff", HighLevelPort._take_off_1),
    2: ("Bff", HighLevelPort._land_1),
    3: ("B", HighLevelPort._stop),
    4: ("B?5f", HighLevelPort._go_to_1),
    5: ("B??Bf", HighLevelPort._start_1),
    6: ("3BIB", HighLevelPort._define),
    7: ("Bff?f", HighLevelPort._take_off),
    8: ("Bff?f", HighLevelPort._land),
    9: ("Bf?f?f", HighLevelPort._take_off_at_speed),
    10: ("Bf?f?f", HighLevelPort._land_at_speed),
    11: ("B??5f", HighLevelPort._spiral),
    12: ("B??5f", HighLevelPort._go_to),
    13: ("B???Bf", HighLevelPort._start),
}
"""Command -> (fields, handler). 1, 2, 4 and 5 are those of older clients."""

_PLANS = tuple(command for command in _COMMANDS if command not in (0, 3, 6))
"""Commands that are refused while the vehicle cannot fly, whomever they are for."""

_FOR_ALL = (0, 6)
"""Commands that do not begin with the group of vehicles that they are for."""
