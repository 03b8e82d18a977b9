"""Port 15: the link itself; echo and identification."""

from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.link.crtp import MAX_DATA

_ECHO, _SOURCE, _SINK = 0, 1, 2

_IDENTITY = b"Bitcraze Crazyflie"


def handle(firmware: Firmware, channel: int, data: bytes) -> bytes | None:
    """Return the data of the answer; None for no answer."""
    if channel == _ECHO:
        return data
    if channel == _SOURCE:
        return _IDENTITY.ljust(MAX_DATA, b"\0")
    if channel != _SINK:
        firmware.warn("link", f"LINK: unknown channel {channel}")
    return None
