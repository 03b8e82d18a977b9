"""Addresses that are good and bad, and the texts of the errors."""

import pytest

from crazyflie_link.address import Address
from crazyflie_link.errors import AddressError


@pytest.mark.parametrize(
    ("uri", "scheme"),
    [
        ("radio://0/25/2M/E7E7E7E701", "radio"),
        ("radio://0/125/250K", "radio"),
        ("radio://0123456789AB/0/1M/1?rate_limit=100", "radio"),
        ("udp://127.0.0.1:19850", "udp"),
        (" udp://drone.local:65535\n", "udp"),
        ("tcp://192.168.4.1:5000", "tcp"),
        ("usb://0", "usb"),
    ],
)
def test_good_addresses(uri, scheme):
    address = Address.parse(uri)
    assert address == Address(uri.strip(), scheme)
    assert address.is_radio == (scheme == "radio")


@pytest.mark.parametrize(
    "uri",
    [
        "",
        "radio",
        "radio://0",
        "radio://0/126/2M",
        "radio://0/25/3M",
        "radio://0/25/2M/E7E7E7E70G",
        "radio://0/25/2M/E7E7E7E7E7E7",
        "udp://127.0.0.1",
        "udp://127.0.0.1:0",
        "udp://127.0.0.1:65536",
        "udp://:19850",
        "http://127.0.0.1:80",
        "usb://a",
        None,
    ],
)
def test_bad_addresses_are_shown_with_what_is_expected(uri):
    with pytest.raises(AddressError) as caught:
        Address.parse(uri)
    assert repr(str(uri)) in str(caught.value)
    assert "expected radio://" in str(caught.value)
