"""Trajectories by time, and checks of those that may begin late."""

import numpy as np
import pytest

from crazyflie_mission_api import DryRun, MissionError
from crazyflie_mission_api.trajectories import TimedTrajectory, check_with_skew, straight

WAY = straight((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), seconds=2.0)


def test_positions_are_those_of_the_time():
    way = TimedTrajectory(WAY, 3.0)
    assert way.end == 5.0
    places = way.positions(np.array([2.0, 4.0, 5.0, 9.0]))
    np.testing.assert_allclose(places, [(0, 0, 1), (0.5, 0, 1), (1, 0, 1), (1, 0, 1)], atol=1e-9)
    assert way.later(0.5).goal(4.5).position == pytest.approx((0.5, 0.0, 1.0))


def checked(skews, now=3.0):
    """Return the beginnings with which trajectories that begin at 3 s are checked."""
    found = []
    ways = {name: TimedTrajectory(WAY, 3.0, skew) for name, skew in zip("abc", skews, strict=False)}
    check_with_skew(ways, now, lambda each: found.append([way.begin for way in each.values()]))
    return found


def test_each_vehicle_is_also_checked_as_late_as_the_latest():
    assert checked((0.1, 0.15)) == [[3.0, 3.0], [3.15, 3.0], [3.0, 3.15]]
    assert checked((0.0, 0.0)) == [[3.0, 3.0]]
    assert checked((0.1,)) == [[3.0]]
    # At their ends none is late any more.
    assert checked((0.1, 0.1), now=6.0) == [[3.0, 3.0]]


def test_a_late_vehicle_is_named():
    def refuse(ways):
        if ways["b"].begin > 3.0:
            raise MissionError("too near")

    ways = {name: TimedTrajectory(WAY, 3.0, 0.1) for name in "ab"}
    with pytest.raises(MissionError, match="too near; this happens if b begins 0.1 s after"):
        check_with_skew(ways, 3.0, refuse)


def test_a_vehicle_begins_in_time_unless_it_is_said_to_be_late():
    group = DryRun({"a": (0, 0, 0), "b": (1, 0, 0)}, start_skews={"a": 0.15})
    assert [vehicle.start_skew for vehicle in group._vehicles.values()] == [0.15, 0.0]
