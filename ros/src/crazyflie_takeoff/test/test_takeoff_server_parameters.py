"""The parameters of the takeoff server."""

import math

import pytest
from takeoff_helpers import BARE, SERVER

from crazyflie_takeoff.takeoff_server_node import TakeoffServerNode
from crazyflie_utils.testing import FakeProcess


@pytest.mark.parametrize("name", BARE)
def test_required_parameters(name):
    process = FakeProcess()
    parameters = {key: value for key, value in BARE.items() if key != name}
    assert not process.launch(TakeoffServerNode(), "/takeoff_server", parameters)
    assert f"/takeoff_server/{name} is not set" in process.logged("error")[0]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("topics/reference", ""),
        ("topics/control", 3),
        ("topics/in_flight", "in flight"),
        ("topics/state", ""),
        ("topics/flight_state", 1.0),
        ("topics/filter_state", "?"),
        ("hover/x", "left"),
        ("hover/y", math.inf),
        ("hover/z", math.nan),
        ("duration/open_loop", -1.0),
        ("duration/open_loop", 5.1),
        ("duration/hover", "long"),
        ("landing/descent_speed", -0.3),
        ("landing/descent_speed", 0.04),
        ("landing/descent_speed", 1.1),
        ("landing/descent_speed", math.nan),
        ("srv/takeoff", ""),
        ("srv/land", 7),
    ],
)
def test_bad_parameters_are_named(name, value):
    process = FakeProcess()
    parameters = {**SERVER, name: value}
    assert not process.launch(TakeoffServerNode(), "/takeoff_server", parameters)
    assert f"/takeoff_server/{name} is" in process.logged("error")[0]
    assert "expected" in process.logged("error")[0]
