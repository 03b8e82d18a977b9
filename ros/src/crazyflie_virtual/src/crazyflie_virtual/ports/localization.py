"""Port 6: positions and poses from outside."""

import math
import struct

from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.quaternions import decompress_quaternion
from crazyflie_virtual.tables.memories import LighthouseMemory

_POSITION, _GENERIC, _PACKED_POSITIONS = 0, 1, 2
_EMERGENCY_STOP, _EMERGENCY_WATCHDOG, _POSE, _PACKED_POSES = 3, 4, 8, 9
_STORE_LIGHTHOUSE = 11

_PACKED_POSITION = struct.Struct("<B3h")
_PACKED_POSE = struct.Struct("<B3hI")


class LocalizationPort:
    """Hands external measurements to the estimator.

    ``address`` is the last byte of the radio's: packed positions and poses of several vehicles are
    marked with it.
    """

    def __init__(self, firmware: Firmware, address: int, lighthouse: LighthouseMemory):
        self._firmware = firmware
        self._address = address
        self._lighthouse = lighthouse

    def handle(self, channel: int, data: bytes) -> bytes | None:
        """Process a measurement; only to storing lighthouse data there is an answer."""
        if channel == _POSITION and len(data) == 12:
            self._take_position(struct.unpack("<fff", data))
        elif channel == _PACKED_POSITIONS:
            for values in _each(_PACKED_POSITION, data):
                if values[0] == self._address:
                    self._take_position([part / 1000.0 for part in values[1:]])
        elif channel == _GENERIC and len(data) == 5 and data[0] == _STORE_LIGHTHOUSE:
            done = self._lighthouse.store(*struct.unpack_from("<HH", data, 1))
            return bytes([_STORE_LIGHTHOUSE, done])
        elif channel == _GENERIC and data:
            self._generic(data[0], data[1:])
        else:
            text = f"LOC: nothing done with {len(data)} bytes on channel {channel}"
            self._firmware.warn("location", text)
        return None

    def _generic(self, command, data):
        supervisor = self._firmware.supervisor
        if command == _POSE and len(data) == 28:
            values = struct.unpack("<7f", data)
            self._take_pose(values[:3], values[3:])
        elif command == _PACKED_POSES:
            for values in _each(_PACKED_POSE, data):
                if values[0] == self._address:
                    position = [part / 1000.0 for part in values[1:4]]
                    self._take_pose(position, decompress_quaternion(values[4]))
        elif command == _EMERGENCY_STOP:
            supervisor.stop()
        elif command == _EMERGENCY_WATCHDOG:
            supervisor.feed_watchdog(self._firmware.time)
        else:
            self._firmware.warn("location", f"LOC: nothing done with a message {command}")

    def _take_position(self, position):
        if all(map(math.isfinite, position)):
            self._firmware.localization.take_position(self._firmware.time, position)
        else:
            self._refuse()

    def _take_pose(self, position, quaternion):
        norm = math.hypot(*quaternion)
        # No rotation, or not a number.
        if not (all(map(math.isfinite, position)) and 0.5 < norm < 2.0):
            self._refuse()
            return
        unit = tuple(part / norm for part in quaternion)
        self._firmware.localization.take_pose(self._firmware.time, position, unit)

    def _refuse(self):
        self._firmware.warn("location", "LOC: a measurement that is not a number, or no rotation")


def _each(form, data):
    return form.iter_unpack(data[: len(data) // form.size * form.size])
