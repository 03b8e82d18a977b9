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

DEFAULT_ADDRESS = "E7E7E7E7E7"  #: Radio address of new vehicles, and of URIs without one.
_HIGHEST_CHANNEL, _HIGHEST_PORT = 125, 65535
#: Number of digits that cflib treats as a serial number; fewer are a dongle's number.
_SERIAL_LENGTH = 10
_THIS_MACHINE = "127.0.0.1"


@dataclass(frozen=True)
class Address:
    """A vehicle's address in cflib's form, known to be well formed: radio, udp, tcp or usb."""

    uri: str
    scheme: str
    #: The same for all spellings of addresses that lead to one vehicle. The dongle and the text
    #: after a question mark are ignored. Names of hosts are not looked up: one other than localhost
    #: differs from its number.
    key: str
    #: Name of the group of vehicles that a broadcast reaches: channel and rate, for any dongle.
    #: Vehicles on UDP are on one channel; any other is alone on its own.
    channel: str
    #: The Crazyradio of a radio's address, number or serial number; empty without a radio.
    dongle: str = ""
    #: Last byte of the radio's address, by which packed poses name it; None if unknown.
    vehicle_id: int | None = None

    @property
    def is_radio(self) -> bool:
        """Whether a Crazyradio is between us and the vehicle."""
        return self.scheme == "radio"

    @classmethod
    def parse(cls, uri: str) -> "Address":
        """Return the address in a text; raise `AddressError` if it is malformed."""
        text = str(uri).strip()
        scheme = text.partition("://")[0]
        match = _FORMS[scheme].fullmatch(text) if scheme in _FORMS else None
        if match is None:
            raise AddressError(f"{text!r} is not an address of a vehicle: expected {EXPECTED}")
        parts = match.groupdict("")
        if scheme == "radio":
            if int(parts["channel"]) > _HIGHEST_CHANNEL:
                raise AddressError(
                    f"{text!r}: no radio channel {parts['channel']}; expected {EXPECTED}"
                )
            channel = f"{int(parts['channel'])}/{parts['rate']}"
            number = int(parts["address"] or DEFAULT_ADDRESS, 16)
            key, dongle = f"radio://*/{channel}/{number:010X}", parts["dongle"].upper()
            if dongle.isdigit() and len(dongle) < _SERIAL_LENGTH:
                dongle = str(int(dongle))
            return cls(text, scheme, key, channel, dongle, number & 0xFF)
        if scheme == "usb":
            key = f"usb://{int(parts['number'])}"
        else:
            if not 0 < int(parts["port"]) <= _HIGHEST_PORT:
                raise AddressError(f"{text!r}: no port {parts['port']}; expected {EXPECTED}")
            key = f"{scheme}://{_host_key(parts['host'])}:{int(parts['port'])}"
        return cls(text, scheme, key, channel=scheme if scheme == "udp" else key)


def radio_address(text: str) -> int:
    """Return the radio address in a text; `AddressError` without up to 10 hexadecimal digits."""
    digits = text.lower().removeprefix("0x")
    if not re.fullmatch("[0-9a-f]{1,10}", digits):
        raise AddressError(f"{text!r} is not a radio address: expected up to 10 hexadecimal digits")
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
