"""Port 15: the link itself."""

from crazyflie_virtual.firmware.console import Warn
from crazyflie_virtual.link.crtp import MAX_DATA, Packet, Port

_ECHO, _SOURCE, _SINK = 0, 1, 2

_IDENTITY = b"Bitcraze Crazyflie"


class LinkPort:
    """Echo and identification.

    Parameters
    ----------
    warn : callable
        See `Console.warn`.
    """

    port = Port.LINK

    def __init__(self, warn: Warn):
        self._warn = warn

    def handle(self, packet: Packet) -> list[Packet]:
        """Return the answers to a packet."""
        if packet.channel == _ECHO:
            return [packet]
        if packet.channel == _SOURCE:
            return [Packet(Port.LINK, _SOURCE, _IDENTITY.ljust(MAX_DATA, b"\0"))]
        if packet.channel != _SINK:
            self._warn("link", f"LINK: unknown channel {packet.channel}")
        return []
