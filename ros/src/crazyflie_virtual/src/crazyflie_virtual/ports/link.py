"""Port 15: the link itself."""

from crazyflie_virtual.link.crtp import MAX_DATA, Packet, Port

_ECHO, _SOURCE, _SINK = 0, 1, 2

_IDENTITY = b"Bitcraze Crazyflie"


class LinkPort:
    """Echo, and who is there."""

    port = Port.LINK

    def handle(self, packet: Packet) -> list[Packet]:
        """Return the answers to a packet."""
        if packet.channel == _ECHO:
            return [packet]
        if packet.channel == _SOURCE:
            return [Packet(Port.LINK, _SOURCE, _IDENTITY.ljust(MAX_DATA, b"\0"))]
        return []
