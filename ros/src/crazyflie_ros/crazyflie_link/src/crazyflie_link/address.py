"""Addresses of vehicles."""

import ipaddress
import re
import socket
from dataclasses import dataclass

from crazyflie_link.errors import AddressError

_FORMS = {
    "radio": re.compile(
        r"radio://(?P<dongle>[0-9A-Za-z]+)/(?P<channel>\d{1,3})/(?P<rate>250K|1M|2M)"
        r"(/(?P<address>[0-9A-Fa-f]{1,10}))?(\?[^\s]*)?"
    ),
    "udp": re.compile(r"udp://(?P<host>[^\s/:?]+):(?P<port>\d{1,5})"),
    "tcp": re.compile(r"tcp://(?P<host>[^\s/:?]+):(?P<port>\d{1,5})"),
    "usb": re.compile(r"usb://(?P<number>\d+)"),
}

#: The forms of an address, for errors.
EXPECTED = (
    "radio://DONGLE/CHANNEL/RATE/ADDRESS such as radio://0/25/2M/E7E7E7E701 (channel 0 to "
    "125, rate 250K, 1M or 2M, address at most 10 hexadecimal digits), udp://HOST:PORT, "
    "tcp://HOST:PORT or usb://NUMBER"
)

_HIGHEST_CHANNEL = 125
DEFAULT_ADDRESS = "E7E7E7E7E7"  #: Radio address of new vehicles, and of URIs without one.
_HIGHEST_PORT = 65535
#: Number of digits that cflib treats as a serial number; fewer are a dongle's number.
_SERIAL_LENGTH = 10
_THIS_MACHINE = "127.0.0.1"


@dataclass(frozen=True)
class Address:
    """A vehicle's address in cflib's form, known to be well formed: radio, udp, tcp or usb."""

    uri: str
    scheme: str

    @property
    def is_radio(self) -> bool:
        """Whether a Crazyradio is between us and the vehicle."""
        return self.scheme == "radio"

    @property
    def channel(self) -> str:
        """Name of the group of vehicles that a broadcast reaches: channel and rate, for any dongle.

        Vehicles on UDP are on one channel; any other is alone on its own.
        """
        parts = self._parts
        if self.scheme == "radio":
            return f"{int(parts['channel'])}/{parts['rate']}"
        return self.scheme if self.scheme == "udp" else self.key

    @property
    def dongle(self) -> str:
        """The Crazyradio of a radio's address, number or serial number; empty without a radio."""
        dongle = self._parts.get("dongle", "").upper()
        return str(int(dongle)) if dongle.isdigit() and len(dongle) < _SERIAL_LENGTH else dongle

    @property
    def key(self) -> str:
        """An address that is the same for all spellings of addresses that lead to one vehicle.

        The dongle and the text after a question mark are ignored. Names of hosts are not looked up:
        one other than localhost differs from its number.
        """
        parts = self._parts
        if self.scheme == "radio":
            return f"radio://*/{self.channel}/{self._radio_address:010X}"
        if self.scheme == "usb":
            return f"usb://{int(parts['number'])}"
        return f"{self.scheme}://{_host_key(parts['host'])}:{int(parts['port'])}"

    @property
    def vehicle_id(self) -> int | None:
        """Last byte of the radio's address, by which packed poses name it; None if unknown."""
        return self._radio_address & 0xFF if self.scheme == "radio" else None

    @property
    def _radio_address(self):
        return int(self._parts["address"] or DEFAULT_ADDRESS, 16)

    @property
    def _parts(self):
        match = _FORMS[self.scheme].fullmatch(self.uri)
        assert match is not None, f"{self.uri} was not parsed"
        return match.groupdict("")

    @classmethod
    def parse(cls, uri: str) -> "Address":
        """Return the address in a text; raise `AddressError` if it is malformed."""
        text = str(uri).strip()
        scheme = text.partition("://")[0]
        match = _FORMS[scheme].fullmatch(text) if scheme in _FORMS else None
        if match is None:
            raise AddressError(f"{text!r} is no address of a vehicle: expected {EXPECTED}")
        parts = match.groupdict()
        if int(parts.get("channel") or 0) > _HIGHEST_CHANNEL:
            raise AddressError(
                f"{text!r}: no radio channel {parts['channel']}; expected {EXPECTED}"
            )
        if not 0 < int(parts.get("port") or 1) <= _HIGHEST_PORT:
            raise AddressError(f"{text!r}: no port {parts['port']}; expected {EXPECTED}")
        return cls(text, scheme)


def radio_address(text: str) -> int:
    """Return the radio address in a text; `AddressError` without up to 10 hexadecimal digits."""
    digits = text.lower().removeprefix("0x")
    if not re.fullmatch("[0-9a-f]{1,10}", digits):
        raise AddressError(f"{text!r} is no radio address: expected up to 10 hexadecimal digits")
    return int(digits, 16)


def _host_key(host: str) -> str:
    if host.lower() in ("localhost", "localhost.localdomain"):
        return _THIS_MACHINE
    try:
        # Accepts short forms such as 127.1; no name server is asked.
        number = ipaddress.ip_address(socket.inet_aton(host))
    except OSError:
        return host.lower().rstrip(".")
    # Every loopback address, and 0.0.0.0, leads to this machine.
    return _THIS_MACHINE if number.is_loopback or number.is_unspecified else str(number)
