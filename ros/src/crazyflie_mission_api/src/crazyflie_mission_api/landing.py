"""How the vehicles of a team come down: in rounds, from below, none on another."""

import math
from typing import Any

import numpy as np

from crazyflie_fleet.landing import next_round
from crazyflie_mission_api import trajectories
from crazyflie_mission_api.course import Course, check_starts
from crazyflie_mission_api.roster import Roster, refuse
from crazyflie_mission_api.vehicle import never

_SINK = 0.3
"""Mean speed of landings, m/s."""

_SHORTEST_LANDING = 2.0
"""s."""

_STOP_AHEAD, _STOP_DURATION = 1.0, 2.0
"""A vehicle on its way stops where it should be so much later, and takes so long, s: at the
beginning it is as fast as it was."""

_ARRIVED, _LATE = 0.05, 0.1
"""So near a vehicle has reached its free place, m; so near it may land there when it is late, m."""

Point = tuple[float, float, float]


class LandingTeam(Roster):
    """Vehicles that land; see `crazyflie_fleet.landing`."""

    def land(self) -> None:
        """Land, and wait until all stand with their motors off.

        Vehicles land where they are, those below before those above them. Where another is beneath
        a vehicle, on the ground or as it is not to land, it flies to the nearest free place first.

        Raises
        ------
        MissionError
            Two would meet; or some cannot land, and who they are.
        """
        refuse("land", self._come_down(is_checked=True))

    def __exit__(self, kind: type[BaseException] | None, error: Any, traceback: Any) -> None:
        """Land who still flies, whatever has happened."""
        try:
            if self.flying and kind is None:
                self.land()
        finally:
            if self.flying:
                refuse("land", self._come_down(is_checked=False))

    def _come_down(self, is_checked: bool) -> dict[str, str]:
        """Land; return why some have not: name to reason.

        Without a check what cannot be without danger is done nevertheless.
        """
        self._stop_on_the_way(is_checked)
        failures: dict[str, str] = {}
        while names := [name for name in self.flying if name not in failures]:
            failures |= self._land_some(names, is_checked)
        return failures

    def _stop_on_the_way(self, is_checked):
        now = self.time()
        stops = {}
        for name in self.flying:
            course = self._courses[name]
            if course.end > now:
                goal = course.goal(now + _STOP_AHEAD)
                stops[name] = (goal.position, goal.yaw)
        if stops:
            self._move(stops, _STOP_DURATION, is_checked)
            self._clock.wait_until(never, now + _STOP_DURATION)

    def _land_some(self, names, is_checked):
        places = self._places()
        known = [*places]
        points = np.array([places[name] for name in known])
        fences = [self._everybody[name].bounds.within(self.rules.bounds) for name in known]
        chosen = next_round(
            points,
            np.array([name in names for name in known]),
            np.array([name not in self._courses for name in known]),
            self.rules.clearance.limits(known),
            np.array([fence.lower[:2] for fence in fences]),
            np.array([fence.upper[:2] for fence in fences]),
        )
        round_ = {known[k]: (*place, places[known[k]][2]) for k, place in chosen.items()}
        failures = self._go_aside(
            {name: goal for name, goal in round_.items() if goal != places[name]}, is_checked
        )
        landing = [name for name in round_ if name not in failures]
        return failures | self._touch_down(landing, is_checked)

    def _places(self) -> dict[str, Point]:
        """Return where all vehicles are, in the air and on the ground: name to m."""
        places: dict[str, Point] = {}
        for name, vehicle in self._everybody.items():
            seen = vehicle.position()
            if name in self._courses:
                told = self._courses[name].goal(self.time()).position
                # What is told is checked; one that is somewhere else is where it is.
                places[name] = told
                if seen is not None and math.dist(seen, told) > self.rules.tolerance:
                    places[name] = seen
            elif seen is not None:
                places[name] = seen
        return places

    def _go_aside(self, goals, is_checked):
        """Have vehicles fly to free places, m; return which do not get there."""
        if not goals:
            return {}
        yaws = {name: self._courses[name].goal(self.time()).yaw for name in goals}
        places = self._places()
        ways = [trajectories.straight(places[name], goal) for name, goal in goals.items()]
        duration = max(1.0, *map(self._quickest, ways))
        moves = {name: (goal, yaws[name]) for name, goal in goals.items()}
        failures = self._move(moves, duration, is_checked)
        told = {name: goal for name, goal in goals.items() if name not in failures}
        end = self.time() + duration
        self._clock.wait_until(never, end)
        self._clock.wait_until(lambda: not self._away(told, _ARRIVED), end + self.rules.patience)
        away = self._away(told, _LATE)
        places = self._places()
        self._courses.update({name: Course.rest(places[name]) for name in away})
        return failures | away

    def _away(self, goals, limit):
        """Return which vehicles are not within a limit (m) of goals (m): name to how far."""
        away = {}
        for name, goal in goals.items():
            place = self._vehicles[name].position()
            far = "not known" if place is None else f"{math.dist(place, goal):.2f} m"
            if place is None or math.dist(place, goal) > limit:
                away[name] = f"stays in the air: its distance from a free place to land is {far}"
        return away

    def _move(self, goals, duration, is_checked):
        """Tell vehicles to fly to positions (m) and yaws (rad); return who refuses."""
        places = self._places()
        ways = {
            name: trajectories.straight(places[name], goal, yaw, yaw, duration)
            for name, (goal, yaw) in goals.items()
        }
        now = self.time()
        courses = {name: self._course(name, way, now) for name, way in ways.items()}
        if is_checked:
            check_starts({**self._courses, **courses}, now, self._check_apart)

        def go(name):
            goal, yaw = goals[name]
            return self._vehicles[name].go_to(goal, yaw, duration)

        failures = self._some(goals)._answers(go)
        self._courses.update({n: course for n, course in courses.items() if n not in failures})
        return failures

    def _touch_down(self, names, is_checked):
        """Land vehicles straight down; return which do not."""
        if not names:
            return {}
        places = self._places()
        duration = max(_SHORTEST_LANDING, *(places[name][2] / _SINK for name in names))
        courses = {}
        for name in names:
            x, y, _ = places[name]
            way = trajectories.straight(places[name], (x, y, 0.0), seconds=duration)
            courses[name] = Course(way, self.time())
        if is_checked:
            self._check_apart(courses)
        failures = self._some(names)._answers(lambda name: self._vehicles[name].land(duration))
        # One that does not land must not keep the others up.
        landing = [name for name in names if name not in failures]
        self._courses.update({name: courses[name] for name in landing})
        limit = self.time() + duration + self.rules.patience
        self._clock.wait_until(
            lambda: all(self._vehicles[name].has_landed() for name in landing), limit
        )
        for name in landing:
            if self._vehicles[name].has_landed():
                self._vehicles[name].rest()
                del self._courses[name]
            else:
                failures[name] = f"not on the ground {self.rules.patience:g} s after it should be"
        return failures
