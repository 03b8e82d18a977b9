"""Port 9: the supervisor; and commands that older clients send to port 13 instead."""

import struct

from crazyflie_virtual.firmware.firmware import Firmware

_INFO, _COMMAND = 0, 1
_FIRST_BIT, _ALL_BITS = 0x01, 0x0C
ARM, RECOVER, _EMERGENCY_STOP, _EMERGENCY_WATCHDOG = 1, 2, 3, 4
_RESPONSE = 0x80


def handle(firmware: Firmware, channel: int, data: bytes) -> bytes | None:
    """Return the data of the answer; None for no answer."""
    if not data:
        return None
    command = data[0]
    answer = None
    if channel == _INFO and _FIRST_BIT <= command <= _ALL_BITS:
        answer = _info(firmware, command)
    elif channel == _COMMAND and ARM <= command <= _EMERGENCY_WATCHDOG:
        answer = execute(firmware, command, data[1:])
    else:
        firmware.warn("supervisor", f"SUP: unknown command {channel}/{command}")
    return None if answer is None else bytes([_RESPONSE | command]) + answer


def execute(firmware: Firmware, command: int, data: bytes) -> bytes | None:
    """Execute a command; return the data of the answer, None for no answer.

    The answer to `ARM` and `RECOVER` is two bytes: done, and armed or recovered.
    """
    supervisor = firmware.supervisor
    if command == ARM:
        # Without its byte the firmware takes the one that an earlier packet
        # has left in its place: nothing changes.
        done = supervisor.arm(bool(data[0]) if data else supervisor.is_armed)
        return bytes([done, supervisor.is_armed])
    if command == RECOVER:
        done = supervisor.recover()
        return bytes([done, not supervisor.is_crashed])
    if command == _EMERGENCY_STOP:
        supervisor.stop()
    elif command == _EMERGENCY_WATCHDOG:
        supervisor.feed_watchdog(firmware.time)
    return None


def _info(firmware, command):
    bits = firmware.info
    if command == _ALL_BITS:
        return struct.pack("<H", bits)
    return bytes([bits >> (command - _FIRST_BIT) & 1])
