"""Texts of cflib's drivers, explained to the operator."""

import re
from pathlib import Path

import pytest

from crazyflie_link.errors import (
    AddressError,
    NoAnswerError,
    NoDongleError,
    explain,
    unknown_name,
)

URI = "radio://0/25/2M/E7E7E7E701"


@pytest.mark.parametrize(
    ("text", "error_type", "advice"),
    [
        (
            "Couldn't load link driver: Cannot find a Crazyradio Dongle\n\nTrace",
            NoDongleError,
            "udev",
        ),
        ("Cannot find radio with serial ABC", NoDongleError, "plug it in"),
        (
            "[Errno 13] Access denied (insufficient permissions)",
            NoDongleError,
            "99-crazyflie.rules",
        ),
        ("[Errno 16] Resource busy", NoDongleError, "another program"),
        ("Too many packets lost", NoAnswerError, "scan"),
        ("Exception: [Errno 111] Connection refused", NoAnswerError, "nothing listens"),
        ("[Errno -2] Name or service not known", AddressError, "IP address"),
        ("[Errno 101] Network is unreachable", NoAnswerError, "network"),
        ("No driver found or malformed URI: usb://7", NoAnswerError, "plugged in"),
    ],
)
def test_known_texts(text, error_type, advice):
    error = explain(URI, text)
    assert type(error) is error_type
    assert str(error).startswith(URI + ": ")
    assert advice in str(error)
    assert "Trace" not in str(error)


def test_unknown_texts_are_passed_on_in_one_line():
    assert str(explain(URI, "\n strange thing\nTraceback ...")) == f"{URI}: strange thing"
    assert str(explain(URI, "")) == f"{URI}: no reason given"


def test_unknown_names_come_with_a_suggestion():
    known = ["stateEstimate.x", "stateEstimate.y", "pm.vbat"]
    text = str(unknown_name("log variable", "stateEstimate.X", known))
    assert "log variable 'stateEstimate.X' among its 3" in text
    assert "did you mean stateEstimate.x" in text
    assert "did you mean" not in str(unknown_name("log variable", "motor.m1", ["pm.vbat"]))
    assert "did you mean pm.vbat" in str(unknown_name("log variable", "pm.q", ["pm.vbat"]))


@pytest.mark.parametrize("device", ["1915:7777", "1915:0101", "0483:5740"])
def test_users_may_open_the_radio_its_boot_loader_and_a_vehicle_on_usb(device):
    rules = (Path(__file__).parents[1] / "udev" / "99-crazyflie.rules").read_text()
    ids = re.findall(r'idVendor}=="(\w+)".*idProduct}=="(\w+)".*GROUP="plugdev"', rules)
    assert device in [":".join(pair) for pair in ids]
