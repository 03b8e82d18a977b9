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
    assert (address.uri, address.scheme) == (uri.strip(), scheme)
    assert address.is_radio == (scheme == "radio")


ONE_VEHICLE = [
    {
        "radio://0/80/2M",
        "radio://0/80/2M/E7E7E7E7E7",
        "radio://0/80/2M/e7e7e7e7e7",
        "radio://0/080/2M/E7E7e7E7E7?safelink=0",
        "radio://1/80/2M?rate_limit=100",
        "radio://0123456789AB/80/2M",
    },
    {"radio://0/80/2M/1", "radio://0/80/2M/0000000001", "radio://2/80/2M/01"},
    {"radio://0/80/1M"},
    {"radio://0/81/2M"},
    {
        "udp://127.0.0.1:19850",
        "udp://localhost:19850",
        "udp://LocalHost:19850",
        "udp://127.1:19850",
        "udp://0.0.0.0:19850",
        " udp://127.0.1.1:19850",
    },
    {"udp://127.0.0.1:1985", "udp://localhost:01985"},
    {"tcp://127.0.0.1:19850", "tcp://localhost:19850"},
    {"udp://drone.local:19850", "udp://Drone.local.:19850"},
    {"udp://192.168.4.1:19850", "udp://192.168.1025:19850"},
    {"usb://0", "usb://00"},
    {"usb://1"},
]
"""Spellings of the addresses of eleven vehicles."""


def test_the_key_of_an_address_is_the_same_for_all_spellings_and_no_other_vehicle():
    keys = [{Address.parse(uri).key for uri in spellings} for spellings in ONE_VEHICLE]
    assert [len(each) for each in keys] == [1] * len(ONE_VEHICLE)
    assert len(set.union(*keys)) == len(ONE_VEHICLE)


@pytest.mark.parametrize(
    ("uri", "dongle"),
    [
        ("radio://0/80/2M", "0"),
        ("radio://01/80/2M", "1"),
        ("radio://e7e7e7e7e7/80/2M", "E7E7E7E7E7"),
        ("radio://0123456789/80/2M", "0123456789"),
        ("udp://127.0.0.1:1", ""),
    ],
)
def test_a_dongle_has_a_number_or_a_serial_number(uri, dongle):
    assert Address.parse(uri).dongle == dongle


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
