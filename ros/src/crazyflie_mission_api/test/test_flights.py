"""Missions of simulated vehicles with all their nodes, by hand-moved time."""

import numpy as np
import pytest
from simulated import NODES, Swarm

from crazyflie_mission_api import Limits
from crazyflie_reports.flight_record import OVERSHOOT_LIMIT

PAIR = ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@pytest.fixture
def pair(monkeypatch, tmp_path):
    """Return two vehicles, 1 m apart."""
    return Swarm(monkeypatch, tmp_path, PAIR)


def test_a_takeoff_goes_to_the_height_that_was_asked_for(pair):
    with pair.fleet() as fleet:
        fleet.takeoff(0.4)
        for name in pair.names:
            assert pair.track(name)[-1, 2] == pytest.approx(0.4, abs=0.05)
            assert pair.track(name)[:, 2].max() < 0.5


def test_a_takeoff_is_no_faster_than_the_mission_and_does_not_overshoot(pair):
    with pair.fleet(limits=Limits(speed=1.0, acceleration=1.5)) as fleet:
        fleet.takeoff(1.0)
        for name in pair.names:
            heights = pair.track(name)[:, 2]
            assert heights.max() - 1.0 < 0.8 * OVERSHOOT_LIMIT
            assert np.diff(heights).max() < 1.0 * NODES["state_estimator"]["time_step"]


def test_a_takeoff_goes_straight_up_from_wherever_the_vehicle_is(pair):
    with pair.fleet() as fleet:
        fleet.takeoff(1.0)
        fleet["cf1"].go_to((1.5, 0.5, 1.0))
        fleet["cf1"].land()
        begin = len(pair.track("cf1"))
        fleet["cf1"].takeoff(0.6)
        # To its hover point, above where it stood at first, it would cross the room.
        way = pair.track("cf1")[begin:]
        assert np.abs(way[:, :2] - (1.5, 0.5)).max() < 0.1
        assert way[:, 2].max() < 0.7
        assert fleet.position("cf1") == pytest.approx((1.5, 0.5, 0.6), abs=0.1)


def test_a_high_takeoff_goes_on_from_where_the_server_leaves_it(pair):
    with pair.fleet() as fleet:
        fleet["cf1"].takeoff(2.5)
        way = pair.track("cf1")
        assert np.abs(way[:, :2]).max() < 0.1
        assert way[-1, 2] == pytest.approx(2.5, abs=0.15)
        assert way[:, 2].max() < 2.65
