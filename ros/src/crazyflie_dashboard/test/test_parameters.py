"""Parameters: what was typed, and what nodes say of theirs."""

import pytest

from crazyflie_dashboard.live_parameters import of_firmware, parsed
from crazyflie_dashboard.page_data import ParameterInfo
from crazyflie_utils.refusal import RefusalError

TREE = {
    "stabilizer": {"estimator": 2, "stop": 0},
    "kalman": {"mNBaro": "2e0"},
    "lqr_controller": {"K_file": "K.txt", "x_dim": 7},
    "takeoff_server": {"hover": {"z": 1.0}},
    "uri": "radio://0/80/2M",
}


def test_firmware_parameters_are_groups_of_numbers():
    found = {each.name: each for each in of_firmware("cf1", TREE)}
    assert found.keys() == {"stabilizer.estimator", "stabilizer.stop", "kalman.mNBaro"}
    # As rosparam has set it.
    assert (found["kalman.mNBaro"].kind, found["kalman.mNBaro"].value) == ("float", 2.0)
    assert found["stabilizer.estimator"].is_firmware


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("float", " 0.5 ", 0.5),
        ("float", "0x10", 16.0),
        ("int", "0x10", 16),
        ("int", "010", 10),
        ("int", "1e3", 1000),
        ("bool", "True", True),
        ("bool", "0", False),
        ("str", "radio", "radio"),
    ],
)
def test_right_values_are_taken(kind, text, value):
    assert parsed(ParameterInfo("/node", "name", kind, value), text) == value


@pytest.mark.parametrize(
    ("kind", "text", "expected"),
    [
        ("float", "nan", "0 to 1 m"),
        ("float", "inf", "0 to 1 m"),
        ("float", "", "a number"),
        ("float", "1e9", "0 to 1 m"),
        ("int", "1.5", "a whole number"),
        ("int", "-3", "0 to 1 m"),
        ("bool", "maybe", "true or false"),
        ("str", "c", "one of a, b"),
    ],
)
def test_wrong_values_are_refused_with_what_was_expected(kind, text, expected):
    choices = ("a", "b") if kind == "str" else ()
    parameter = ParameterInfo(
        "/node", "name", kind, 0, unit="m", minimum=0.0, maximum=1.0, choices=choices
    )
    with pytest.raises(RefusalError, match=f"/node: name is '{text}'; expected .*{expected}"):
        parsed(parameter, text)
