"""Landing of the vehicles of a group: in rounds, from below, none on another."""

import math
from typing import Any

import numpy as np

from crazyflie_fleet.landing import next_round
from crazyflie_mission_api.group_state import GroupState, raise_failures
from crazyflie_mission_api.limits import EVERYWHERE
from crazyflie_mission_api.mission_vehicle import never
from crazyflie_mission_api.observer import command
from crazyflie_mission_api.trajectories import TimedTrajectory, check_with_skew, straight

_DESCENT_SPEED = 0.3  #: Mean speed of landings, m/s.
_SHORTEST_LANDING = 2.0  #: s.

#: A moving vehicle stops at its goal of this much later, within this duration, s: so it begins with
#: the speed that it has.
_STOP_AHEAD, _STOP_DURATION = 1.0, 2.0

#: Distances from a free place, m: arrived; and near enough to land there after the timeout.
_ARRIVED, _NEAR = 0.05, 0.1

Point = tuple[float, float, float]


class LandingGroup(GroupState):
    """Vehicles that land; see `crazyflie_fleet.landing`."""

    @command
    def land(self) -> None:
        """Land, and wait until all vehicles are on the ground with their motors off.

        Vehicles land where they are, those below before those above them. Where another is beneath
        a vehicle, on the ground or in flight outside the group, it flies to the nearest free place
        first.

        Raises
        ------
        MissionError
            Two would meet; or some cannot land, and which.
        """
        raise_failures("land", self._land_all(is_checked=True))

    def __exit__(self, kind: type[BaseException] | None, error: Any, traceback: Any) -> None:
        """Land the vehicles that still fly, also after an error."""
        try:
            if self.flying and kind is None:
                self.land()
        finally:
            if self.flying:
                raise_failures("land", self._land_all(is_checked=False))

    def _land_all(self, is_checked: bool) -> dict[str, str]:
        """Land; return why some vehicles have not: name to reason.

        Without a check vehicles land even if two come too near.
        """
        self._stop_moving(is_checked)
        failures: dict[str, str] = {}
        while names := [name for name in self.flying if name not in failures]:
            failures |= self._land_round(names, is_checked)
        return failures

    def _stop_moving(self, is_checked):
        now = self.time()
        stops = {}
        for name in self.flying:
            trajectory = self._commanded[name]
            if trajectory.end > now:
                goal = trajectory.goal(now + _STOP_AHEAD)
                stops[name] = (goal.position, goal.yaw)
        if stops:
            self._move(stops, _STOP_DURATION, is_checked)
            self._clock.wait_until(never, now + _STOP_DURATION)

    def _land_round(self, names, is_checked):
        places = self._places()
        obstacles = self.obstacles()
        places |= {name: o.position for name, o in obstacles.items() if o.position is not None}
        known = [*places]
        fences = [
            EVERYWHERE if name in obstacles else self._all_vehicles[name].bounds for name in known
        ]
        fences = [fence.within(self.rules.bounds) for fence in fences]
        in_flight = {
            *self._commanded,
            *(name for name, obstacle in obstacles.items() if obstacle.is_flying),
        }
        chosen = next_round(
            np.array([*places.values()]),
            np.array([name in names for name in known]),
            np.array([name not in in_flight for name in known]),
            self.rules.clearance.limits(known),
            np.array([fence.lower[:2] for fence in fences]),
            np.array([fence.upper[:2] for fence in fences]),
        )
        goals = {known[k]: (*place, places[known[k]][2]) for k, place in chosen.items()}
        aside = {name: goal for name, goal in goals.items() if goal != places[name]}
        failures = self._go_aside(aside, is_checked)
        landing = [name for name in goals if name not in failures]
        return failures | self._touch_down(landing, is_checked)

    def _places(self) -> dict[str, Point]:
        """Return the positions of all vehicles: name to m."""
        places: dict[str, Point] = {}
        for name, vehicle in self._all_vehicles.items():
            measured = vehicle.position()
            if name in self._commanded:
                # Commanded positions were checked; a vehicle that is not there counts where it is.
                places[name] = commanded = self._commanded[name].goal(self.time()).position
                if measured is None or math.dist(measured, commanded) <= self.rules.tolerance:
                    continue
            if measured is not None:
                places[name] = measured
        return places

    def _go_aside(self, goals, is_checked):
        """Move vehicles to free places, m; return which do not get there, and why."""
        if not goals:
            return {}
        yaws = {name: self._commanded[name].goal(self.time()).yaw for name in goals}
        places = self._places()
        moves = (straight(places[name], goal) for name, goal in goals.items())
        duration = max(1.0, *map(self._shortest_duration, moves))
        poses = {name: (goal, yaws[name]) for name, goal in goals.items()}
        failures = self._move(poses, duration, is_checked)
        moving = {name: goal for name, goal in goals.items() if name not in failures}
        end = self.time() + duration
        self._clock.wait_until(never, end)
        self._clock.wait_until(
            lambda: not self._away(moving, _ARRIVED), end + self.rules.arrival_timeout
        )
        away = self._away(moving, _NEAR)
        places = self._places()
        self._commanded.update({name: TimedTrajectory.hover(places[name]) for name in away})
        return failures | away

    def _away(self, goals, limit):
        """Return the vehicles that are not within a limit (m) of goals (m): name to reason."""
        away = {}
        for name, goal in goals.items():
            place = self._vehicles[name].position()
            far = "not known" if place is None else f"{math.dist(place, goal):.2f} m"
            if place is None or math.dist(place, goal) > limit:
                away[name] = f"stays in the air: its distance from a free place to land is {far}"
        return away

    def _move(self, poses, duration, is_checked):
        """Command positions (m) and yaws (rad); return the refusals, name to reason."""
        places, now = self._places(), self.time()
        moves = {
            name: self._timed(name, straight(places[name], goal, yaw, yaw, duration), now)
            for name, (goal, yaw) in poses.items()
        }
        if is_checked:
            check_with_skew({**self._commanded, **moves}, now, self._check_apart)

        def go_to(name):
            goal, yaw = poses[name]
            return self._vehicles[name].go_to(goal, yaw, duration)

        failures = self._answers(go_to, poses)
        self._commanded.update({n: move for n, move in moves.items() if n not in failures})
        return failures

    def _touch_down(self, names, is_checked):
        """Land vehicles straight down; return which do not land, and why."""
        if not names:
            return {}
        places = self._places()
        duration = max(_SHORTEST_LANDING, *(places[name][2] / _DESCENT_SPEED for name in names))
        descents = {}
        for name in names:
            x, y, _ = places[name]
            descent = straight(places[name], (x, y, 0.0), seconds=duration)
            descents[name] = TimedTrajectory(descent, self.time())
        if is_checked:
            self._check_apart(descents)
        failures = self._answers(lambda name: self._vehicles[name].land(duration), names)
        # A vehicle that refuses does not keep the others in the air.
        landing = [name for name in names if name not in failures]
        self._commanded.update({name: descents[name] for name in landing})
        limit = self.time() + duration + self.rules.arrival_timeout
        self._clock.wait_until(
            lambda: all(self._vehicles[name].has_landed() for name in landing), limit
        )
        for name in landing:
            if self._vehicles[name].has_landed():
                self._vehicles[name].stop_motors()
                del self._commanded[name]
            else:
                late = f"{self.rules.arrival_timeout:g} s after it should be"
                failures[name] = f"not on the ground {late}"
        return failures
