"""Trajectories by time, and checks of those that may begin late."""

import numpy as np
import pytest

from crazyflie_mission_api import DryRun, MissionError
from crazyflie_mission_api.trajectories import TimedTrajectory, check_apart, straight

WAY = straight((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), seconds=2.0)


def test_positions_are_those_of_the_time():
    way = TimedTrajectory(WAY, 3.0)
    assert way.end == 5.0
    places = way.positions(np.array([2.0, 4.0, 5.0, 9.0]))
    np.testing.assert_allclose(places, [(0, 0, 1), (0.5, 0, 1), (1, 0, 1), (1, 0, 1)], atol=1e-9)
    assert way.later(0.5).goal(4.5).position == pytest.approx((0.5, 0.0, 1.0))


class Checks:
    """In place of a `Clearance`: trajectories pass if their beginnings are ``allowed``."""

    def __init__(self, allowed=lambda begins: True):
        self.found = []
        self.allowed = allowed

    def check(self, names, times, places, resting=()):
        # The vehicles are half way at x = 0.5, after 1 s.
        half = [np.interp(0.5, x, times) for x in places[:, :, 0]]
        begins = np.round(np.subtract(half, 1.0), 2).tolist()
        self.found.append(begins)
        if not self.allowed(dict(zip(names, begins, strict=True))):
            raise MissionError("too near")


def checked(skews, now=3.0):
    """Return the beginnings, from 3 s on, with which trajectories that begin then are checked."""
    checks = Checks()
    ways = {name: TimedTrajectory(WAY, 3.0, skew) for name, skew in zip("abc", skews, strict=False)}
    check_apart(ways, now, checks, may_be_late=True)
    return checks.found


def test_each_vehicle_is_also_checked_as_late_as_the_latest():
    assert checked((0.1, 0.15)) == [[0.0, 0.0], [0.15, 0.0], [0.0, 0.15]]
    assert checked((0.0, 0.0)) == [[0.0, 0.0]]
    assert checked((0.1,)) == []
    # At their ends none is late any more.
    assert len(checked((0.1, 0.1), now=6.0)) == 1


def test_a_late_vehicle_is_named():
    ways = {name: TimedTrajectory(WAY, 3.0, 0.1) for name in "ab"}
    with pytest.raises(MissionError, match="too near; this happens if b begins 0.1 s after"):
        check_apart(ways, 3.0, Checks(lambda begins: begins["b"] == 0.0), may_be_late=True)


def test_a_vehicle_begins_in_time_unless_it_is_said_to_be_late():
    group = DryRun({"a": (0, 0, 0), "b": (1, 0, 0)}, start_skews={"a": 0.15})
    assert [vehicle.start_skew for vehicle in group._vehicles.values()] == [0.15, 0.0]
