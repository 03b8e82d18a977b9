"""Missions of simulated vehicles, as fast as it goes."""

import numpy as np
import pytest

from crazyflie_demo.figure8 import figure8
from crazyflie_mission_api import Bounds, Fleet, Limits, MissionError, plan
from crazyflie_utils.runtime.runner import ros_process

NAMES = ["cf1", "cf2", "cf3"]
ROOM = Bounds((-2.0, -2.0, 0.0), (4.0, 3.0, 2.5))


@pytest.fixture(scope="module")
def fleet():
    """Return the fleet; whatever a test does, all have landed in the end."""
    limits = Limits(speed=1.0, acceleration=1.5)
    with Fleet(NAMES, ROOM, limits, process=ros_process(), patience=60.0) as made:
        yield made


def place(fleet, name):
    """Return where a vehicle is."""
    return np.array(fleet.position(name))


def test_a_mission(fleet):
    seen = {}

    def mission(team):
        team.takeoff(0.8)
        seen["takeoff"] = place(team, "cf2")
        team.go_to({"cf1": (0.0, 1.0, 1.0), "cf3": (2.0, 1.0, 1.2)})
        seen["go_to"] = place(team, "cf3")
        team["cf1"].follow(figure8(), relative=True, wait=False)
        team["cf2"].follow(plan([(1, 0, 0.8), (1.3, -0.5, 1.2), (1, -1, 1)]))
        seen["cf2"] = place(team, "cf2")
        team.arrive()
        seen["cf1"] = place(team, "cf1")
        team.formation([(0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (2.0, 0.0, 1.0)])
        seen["formation"] = place(team, "cf1")
        team.land()

    fleet.fly(mission)
    # The rehearsal has seen the same places first.
    assert seen["takeoff"] == pytest.approx([1.0, 0.0, 0.8], abs=0.16)
    assert seen["go_to"] == pytest.approx([2.0, 1.0, 1.2], abs=0.16)
    assert seen["cf2"] == pytest.approx([1.0, -1.0, 1.0], abs=0.16)
    assert seen["cf1"] == pytest.approx([0.0, 1.0, 1.0], abs=0.16)
    assert seen["formation"] == pytest.approx([0.0, 0.0, 1.0], abs=0.16)
    assert fleet.flying == []
    assert max(place(fleet, name)[2] for name in NAMES) < 0.05


def test_what_is_wrong_is_known_before_anything_flies(fleet):
    def mission(team):
        team.takeoff(0.8)
        team.go_to({"cf2": (1.0, 5.0, 1.0)})

    with pytest.raises(MissionError, match="cf2: go_to is out of bounds: y is 5 m"):
        fleet.fly(mission)
    assert fleet.flying == []
    assert max(place(fleet, name)[2] for name in NAMES) < 0.05


def test_a_vehicle_that_lands_by_itself_is_noticed(fleet):
    some = fleet["cf1", "cf3"]
    some.takeoff(0.8)
    some._handle.call_service("/cf3/land", *_land(), 30.0).result(30.0)
    with pytest.raises(MissionError, match="cf3: it does not fly any more"):
        some.wait(60.0)
    fleet.land()
    assert place(fleet, "cf1")[2] < 0.05


def _land():
    from std_srvs.srv import Empty, EmptyRequest

    return Empty, EmptyRequest()
