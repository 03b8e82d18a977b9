"""Port 15: the link itself."""

from collections.abc import Callable

from crazyflie_virtual.firmware.remarks import Remarks
from crazyflie_virtual.link.crtp import MAX_DATA, Packet, Port

_ECHO, _SOURCE, _SINK = 0, 1, 2

_IDENTITY = b"Bitcraze Crazyflie"


class LinkPort:
    """Echo, and who is there.

    Parameters
    ----------
    on_new_client : callable
        ``on_new_client()`` is called when a client asks who is there: the first
        thing a client does.
    remark : Remarks
    """

    port = Port.LINK

    def __init__(self, on_new_client: Callable[[], None], remark: Remarks):
        self._on_new_client = on_new_client
        self._remark = remark

    def handle(self, packet: Packet) -> list[Packet]:
        """Return the answers to a packet."""
        if packet.channel == _ECHO:
            return [packet]
        if packet.channel == _SOURCE:
            self._on_new_client()
            return [Packet(Port.LINK, _SOURCE, _IDENTITY.ljust(MAX_DATA, b"\0"))]
        if packet.channel != _SINK:
            self._remark("link", f"LINK: unknown channel {packet.channel}")
        return []
