"""Waypoints, and the mission that is made of them."""

import runpy

import pytest

from crazyflie_dashboard.waypoints import Waypoints, save
from crazyflie_mission_api import DryRun
from crazyflie_utils.refusal import RefusalError

A, B, C = (0.5, 0.0, 1.0), (1.0, 0.5, 1.2), (0.0, 0.5, 1.0)


def test_points_are_added_inserted_moved_and_undone():
    waypoints, seen = Waypoints(), []
    waypoints.on_change = lambda: seen.append(waypoints.points)
    waypoints.insert(0, A)
    waypoints.insert(1, C)
    waypoints.insert(1, B)
    waypoints.move(0, C)
    assert waypoints.points == (C, B, C)
    waypoints.clear()
    for _ in range(2):
        waypoints.undo()
    assert waypoints.points == (A, B, C) == seen[-1]
    for _ in range(9):
        waypoints.undo()
    assert waypoints.points == ()


def test_the_mission_leads_the_centre_of_a_formation_through_the_points(tmp_path):
    path = save(tmp_path / "new", "around-the-pole", (A, B))
    mission = runpy.run_path(str(path))["mission"]
    places = []

    class Recorded(DryRun):
        def go_to(self, goals, **details):
            places.append(goals)
            super().go_to(goals, **details)

    with Recorded({"cf1": (-0.5, 0.0, 0.0), "cf2": (0.5, 0.0, 0.0)}) as fleet:
        mission(fleet)
    assert places[0] == {
        "cf1": pytest.approx((0.0, 0.0, 1.0)),
        "cf2": pytest.approx((1.0, 0.0, 1.0)),
    }
    assert places[1]["cf2"] == pytest.approx((1.5, 0.5, 1.2))


@pytest.mark.parametrize("name", ["", "../etc", "a b", "1st", "x.py"])
def test_a_name_that_is_no_file_is_refused(tmp_path, name):
    with pytest.raises(RefusalError, match="expected letters, digits, - and _"):
        save(tmp_path, name, (A,))
    with pytest.raises(RefusalError, match="no waypoint is set"):
        save(tmp_path, "x", ())
    assert list(tmp_path.iterdir()) == []
