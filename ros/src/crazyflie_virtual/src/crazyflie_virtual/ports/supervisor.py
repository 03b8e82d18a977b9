"""Port 9: the supervisor; and what older clients ask of port 13 instead."""

import struct

from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.link.crtp import Packet, Port

_INFO, _COMMAND = 0, 1
_FIRST_BIT, _ALL_BITS = 0x01, 0x0C
_ARM, _RECOVER, _EMERGENCY_STOP, _EMERGENCY_WATCHDOG = 1, 2, 3, 4
_RESPONSE = 0x80


class SupervisorPort:
    """Questions and commands to the supervisor.

    Parameters
    ----------
    firmware : Firmware
    """

    port = Port.SUPERVISOR

    def __init__(self, firmware: Firmware):
        self._firmware = firmware

    def handle(self, packet: Packet) -> list[Packet]:
        """Return the answers to a packet."""
        if not packet.data:
            return []
        command = packet.data[0]
        answer = None
        if packet.channel == _INFO and _FIRST_BIT <= command <= _ALL_BITS:
            answer = self._info(command)
        elif packet.channel == _COMMAND and _ARM <= command <= _EMERGENCY_WATCHDOG:
            answer = self.command(command, packet.data[1:])
        else:
            text = f"SUP: unknown command {packet.channel}/{command}"
            self._firmware.warn("supervisor", text)
        if answer is None:
            return []
        return [Packet(Port.SUPERVISOR, packet.channel, bytes([_RESPONSE | command]) + answer)]

    def command(self, command: int, data: bytes) -> bytes | None:
        """Carry out a command; return what is answered, or None.

        To arm and to recover are answered with: done, and armed or recovered.
        """
        supervisor = self._firmware.supervisor
        if command == _ARM:
            # Without its byte the firmware takes the one that an earlier packet
            # has left in its place: nothing changes.
            done = supervisor.arm(bool(data[0]) if data else supervisor.is_armed)
            return bytes([done, supervisor.is_armed])
        if command == _RECOVER:
            done = supervisor.recover()
            return bytes([done, not supervisor.is_crashed])
        if command == _EMERGENCY_STOP:
            supervisor.stop()
        elif command == _EMERGENCY_WATCHDOG:
            supervisor.feed_watchdog(self._firmware.time)
        return None

    def _info(self, command):
        bits = self._firmware.info
        if command == _ALL_BITS:
            return struct.pack("<H", bits)
        return bytes([bits >> (command - _FIRST_BIT) & 1])
