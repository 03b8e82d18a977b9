"""How far apart missions keep vehicles: the mission's separation, and the fleet's buffers."""

import numpy as np
import pytest

from crazyflie_fleet.separation import RELEASE_RATIO, Separation
from crazyflie_mission_api import DryRun, MissionError
from crazyflie_mission_api.group_state import Rules
from crazyflie_mission_api.limits import Clearance

STARTS = {"cf1": (0.0, 0.0, 0.0), "cf2": (2.0, 0.0, 0.0), "cf3": (0.0, 2.0, 0.0)}


def group(**rules):
    """Return three vehicles that hover at 1 m."""
    made = DryRun(STARTS, Rules(**rules))
    made.takeoff(1.0)
    return made


def test_limits_of_each_two():
    clearance = Clearance(0.3, {"a": 0.4, "b": 0.1})
    limits = clearance.limits(["a", "b", "c"])
    assert limits[0, 1] == limits[1, 0] == pytest.approx(RELEASE_RATIO * 0.5)
    # Whom no fleet watches, it does not hold.
    assert limits[0, 2] == limits[1, 2] == 0.3


def test_a_place_that_is_too_near_for_the_fleet_is_refused_and_both_limits_are_named():
    near = (1.4, 0.0, 1.0)
    group()["cf1"].go_to(near)
    flying = group(buffers={"cf1": 0.3, "cf2": 0.35, "cf3": 0.1})
    text = (
        r"cf1 and cf2 would be 0\.\d+ m apart, .* expected at least 0.715 m \(the mission's "
        r"separation is 0.3 m; the collision buffers, .* are 0.3 and 0.35 m, and 1.1 times as much"
    )
    with pytest.raises(MissionError, match=text):
        flying["cf1"].go_to(near)
    flying["cf1"].go_to((1.2, 0.0, 1.0))


def test_what_is_between_buffers_and_release_would_be_held_for_ever():
    # At 0.64 m the fleet, once it holds the vehicle, does not let it go again.
    places, still = np.array([(0.0, 0.0, 1.0), (0.64, 0.0, 1.0)]), np.zeros((2, 3))
    separation, wanted = Separation([0.31, 0.31]), places + [[0.01, 0.0, 0.0], [0.0, 0.0, 0.0]]
    assert not separation.update(places, still, wanted)[0].any()
    assert separation.update(places, still + [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], wanted)[0][0]
    assert separation.update(places, still, wanted)[0][0]
    with pytest.raises(MissionError, match="at least 0.682 m"):
        group(buffers={"cf1": 0.31, "cf2": 0.31})["cf1"].go_to((1.36, 0.0, 1.0))


def test_vehicles_on_the_ground_count_too():
    made = DryRun(STARTS)
    made["cf1"].takeoff(0.5)
    with pytest.raises(MissionError, match=r"cf2 and cf1 would be 0\.\d+ m apart"):
        made["cf1"].go_to((2.0, 0.0, 0.5))
    made["cf1"].go_to((2.0, 0.0, 0.7))
