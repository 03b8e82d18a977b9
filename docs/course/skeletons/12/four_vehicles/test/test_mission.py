"""The mission as a dry run: ideal vehicles, all checks, no ROS."""

import pytest

from crazyflie_mission_api import DryRun, MissionError
from crazyflie_mission_api.group_state import Rules
from four_vehicles.mission import LIMITS, ROOM, SIDE, mission, square

STARTS = {
    "cf1": (-0.5, -0.5, 0),
    "cf2": (-0.5, 0.5, 0),
    "cf3": (0.5, -0.5, 0),
    "cf4": (0.5, 0.5, 0),
}


class Recorder(DryRun):
    """A dry run that remembers where vehicles were sent."""

    visited: list

    def go_to(self, goals, *arguments, **options):
        self.visited.append(goals)
        super().go_to(goals, *arguments, **options)


def test_the_square_is_one():
    assert len(square()) == 4
    for (x0, y0, _), (x1, y1, _) in zip(square(), square()[1:] + square()[:1], strict=True):
        assert ((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5 == pytest.approx(SIDE)


def test_every_vehicle_visits_every_corner_and_lands():
    fleet = Recorder(STARTS, Rules(bounds=ROOM, limits=LIMITS))
    fleet.visited = []
    with fleet:
        mission(fleet)
        assert fleet.flying == []
    assert len(fleet.visited) == 5  # the formation is the first
    for name in STARTS:
        assert {tuple(goals[name]) for goals in fleet.visited} == {tuple(p) for p in square()}


def test_straight_through_the_middle_is_refused():
    with DryRun(STARTS, Rules(bounds=ROOM, limits=LIMITS)) as fleet:
        fleet.takeoff(1.0)
        corners = square()
        places = fleet.formation(corners)
        opposite = {name: (-x, -y, z) for name, (x, y, z) in places.items()}
        with pytest.raises(MissionError, match="apart"):
            fleet.go_to(opposite)
        fleet.land()
