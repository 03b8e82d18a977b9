"""Port 13: what the vehicle is; and commands of older clients."""

import struct

from crazyflie_virtual.firmware.console import Warn
from crazyflie_virtual.link.crtp import MAX_DATA, Packet, Port
from crazyflie_virtual.ports.supervisor import SupervisorPort

_COMMAND, _VERSION = 0, 1
_CONTINUOUS_WAVE, _ARM, _RECOVER, _NOTIFY = 0, 1, 2, 3
_PROTOCOL, _FIRMWARE, _DEVICE = 0, 1, 2

DEVICE = "Crazyflie 2.1"
FIRMWARE = "2026.08 virtual"
"""Names; the firmware is the release whose behaviour is imitated."""


class PlatformPort:
    """Versions and platform commands.

    Parameters
    ----------
    protocol : int
        Version of the protocol to report.
    supervisor : SupervisorPort
        Which arms and recovers.
    warn : callable
        See `Console.warn`.
    """

    port = Port.PLATFORM

    def __init__(self, protocol: int, supervisor: SupervisorPort, warn: Warn):
        self._protocol = protocol
        self._supervisor = supervisor
        self._warn = warn

    def handle(self, packet: Packet) -> list[Packet]:
        """Return the answers to a packet."""
        if not packet.data:
            return []
        command, data = packet.data[0], packet.data[1:]
        answer = None
        if packet.channel == _VERSION:
            answer = self._version(command)
        elif packet.channel == _COMMAND and command in (_ARM, _RECOVER):
            answer = self._supervisor.command(command, data)
        elif packet.channel == _COMMAND and command in (_CONTINUOUS_WAVE, _NOTIFY):
            answer = data
        else:
            self._warn("platform", f"PLATFORM: unknown command {packet.channel}/{command}")
        if answer is None:
            return []
        return [Packet(Port.PLATFORM, packet.channel, bytes([command]) + answer)]

    def _version(self, command):
        if command == _PROTOCOL:
            return struct.pack("<i", self._protocol)
        texts = {_FIRMWARE: FIRMWARE, _DEVICE: DEVICE}
        if command in texts:
            return texts[command].encode()[: MAX_DATA - 1]
        self._warn("platform", f"PLATFORM: unknown version {command}")
        return None
