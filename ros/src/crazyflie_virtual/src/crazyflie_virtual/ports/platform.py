"""Port 13: versions; and commands of older clients."""

import struct

from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.link.crtp import MAX_DATA
from crazyflie_virtual.ports import supervisor

_COMMAND, _VERSION = 0, 1
_CONTINUOUS_WAVE, _NOTIFY = 0, 3
_PROTOCOL, _FIRMWARE, _DEVICE = 0, 1, 2

#: The firmware is the release whose behaviour is imitated.
_NAMES = {_FIRMWARE: "2026.08 virtual", _DEVICE: "Crazyflie 2.1"}


def handle(firmware: Firmware, channel: int, data: bytes) -> bytes | None:
    """Return the data of the answer; None for no answer."""
    if not data:
        return None
    command, rest = data[0], data[1:]
    answer = None
    if channel == _VERSION:
        answer = _version(firmware, command)
    elif channel == _COMMAND and command in (supervisor.ARM, supervisor.RECOVER):
        answer = supervisor.execute(firmware, command, rest)
    elif channel == _COMMAND and command in (_CONTINUOUS_WAVE, _NOTIFY):
        answer = rest
    else:
        firmware.warn("platform", f"PLATFORM: unknown command {channel}/{command}")
    return None if answer is None else bytes([command]) + answer


def _version(firmware, command):
    if command == _PROTOCOL:
        return struct.pack("<i", firmware.protocol)
    if command in _NAMES:
        return _NAMES[command].encode()[: MAX_DATA - 1]
    firmware.warn("platform", f"PLATFORM: unknown version {command}")
    return None
