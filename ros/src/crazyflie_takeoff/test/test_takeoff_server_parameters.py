"""The parameters of the takeoff server."""

import math

import pytest
from takeoff_helpers import BARE, SERVER

from crazyflie_takeoff.flight_topics import derived_topic
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
        ("topics/flight_status", 1.0),
        ("topics/filter_status", "?"),
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


@pytest.mark.parametrize(
    "values",
    [
        {"landing/descent_speed": 0.0},
        {"landing/descent_speed": 0.05},
        {"landing/descent_speed": 1.0},
        {"battery/low": 3.1, "battery/critical": 3.1},
        {"hover/z": 3.0, "box/max/z": 3.0},
    ],
)
def test_values_at_the_end_of_a_range_are_accepted(values):
    assert FakeProcess().launch(TakeoffServerNode(), "/takeoff_server", {**SERVER, **values})


def test_a_topic_has_its_own_name_or_that_of_another_with_a_suffix():
    class Topics:
        own_state_topic, in_flight_topic = None, "/in_flight"
        state_topic = derived_topic("state", "in_flight", "_state")

    topics = Topics()
    assert topics.state_topic == "/in_flight_state"
    topics.own_state_topic = "/cf1/state"
    assert topics.state_topic == "/cf1/state"
    topics.own_state_topic = topics.in_flight_topic = None
    assert topics.state_topic is None
