"""Addresses of vehicles."""

import re
from dataclasses import dataclass

from crazyflie_link.errors import AddressError

_FORMS = {
    "radio": re.compile(
        r"radio://(?P<dongle>[0-9A-Za-z]+)/(?P<channel>\d{1,3})/(?P<rate>250K|1M|2M)"
        r"(/(?P<address>[0-9A-Fa-f]{1,10}))?(\?[^\s]*)?"
    ),
    "udp": re.compile(r"udp://(?P<host>[^\s/:?]+):(?P<port>\d{1,5})"),
    "tcp": re.compile(r"tcp://(?P<host>[^\s/:?]+):(?P<port>\d{1,5})"),
    "usb": re.compile(r"usb://\d+"),
}

_EXPECTED = (
    "expected radio://DONGLE/CHANNEL/RATE/ADDRESS such as radio://0/25/2M/E7E7E7E701 (channel 0 to "
    "125, rate 250K, 1M or 2M, address at most 10 hexadecimal digits), udp://HOST:PORT, "
    "tcp://HOST:PORT or usb://NUMBER"
)

_HIGHEST_CHANNEL = 125
_DEFAULT_ID = 0xE7
_HIGHEST_PORT = 65535


@dataclass(frozen=True)
class Address:
    """A vehicle's address as cflib takes it, known to be well formed: radio, udp, tcp or usb."""

    uri: str
    scheme: str

    @property
    def is_radio(self) -> bool:
        """Whether a Crazyradio is between us and the vehicle."""
        return self.scheme == "radio"

    @property
    def channel(self) -> str:
        """What vehicles share that a broadcast reaches: dongle, channel and rate of a radio.

        Vehicles on UDP are on one channel; any other is alone on its own.
        """
        if self.is_radio:
            return "/".join(self.uri.partition("?")[0].split("/")[:5])
        return self.scheme if self.scheme == "udp" else self.uri

    @property
    def vehicle_id(self) -> int | None:
        """Last byte of the radio's address, by which packed poses name it; None if unknown."""
        if not self.is_radio:
            return None
        address = self.uri.partition("?")[0].split("/")[5:]
        return int(address[0], 16) & 0xFF if address else _DEFAULT_ID

    @classmethod
    def parse(cls, uri: str) -> "Address":
        """Return the address that a text stands for; raise `AddressError` if it is none."""
        text = str(uri).strip()
        scheme = text.partition("://")[0]
        match = _FORMS[scheme].fullmatch(text) if scheme in _FORMS else None
        if match is None:
            raise AddressError(f"{text!r} is no address of a vehicle: {_EXPECTED}")
        parts = match.groupdict()
        if int(parts.get("channel") or 0) > _HIGHEST_CHANNEL:
            raise AddressError(f"{text!r}: no radio channel {parts['channel']}; {_EXPECTED}")
        if not 0 < int(parts.get("port") or 1) <= _HIGHEST_PORT:
            raise AddressError(f"{text!r}: no port {parts['port']}; {_EXPECTED}")
        return cls(text, scheme)
