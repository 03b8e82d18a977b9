"""Port 15: the link itself."""

from crazyflie_virtual.firmware.remarks import Remarks
from crazyflie_virtual.link.crtp import MAX_DATA, Packet, Port

_ECHO, _SOURCE, _SINK = 0, 1, 2

_IDENTITY = b"Bitcraze Crazyflie"


class LinkPort:
    """Echo, and who is there.

    Parameters
    ----------
    remark : Remarks
    """

    port = Port.LINK

    def __init__(self, remark: Remarks):
        self._remark = remark

    def handle(self, packet: Packet) -> list[Packet]:
        """Return the answers to a packet."""
        if packet.channel == _ECHO:
            return [packet]
        if packet.channel == _SOURCE:
            return [Packet(Port.LINK, _SOURCE, _IDENTITY.ljust(MAX_DATA, b"\0"))]
        if packet.channel != _SINK:
            self._remark("link", f"LINK: unknown channel {packet.channel}")
        return []
