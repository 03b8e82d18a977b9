"""Landing of the vehicles of a group: in rounds, the lowest first, none above another."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from typing_extensions import override

from crazyflie_fleet.landing_rounds import LandingSide, Place, Scene, land_in_rounds
from crazyflie_mission_api.group_state import GroupState
from crazyflie_mission_api.limits import EVERYWHERE
from crazyflie_mission_api.mission_vehicle import Move, never
from crazyflie_mission_api.trajectories import TimedTrajectory, straight

_DESCENT_SPEED = 0.3  #: Mean speed of landings (m/s).
_SHORTEST_LANDING = 2.0  #: Shortest duration of a landing (s).

#: Time ahead whose goal a moving vehicle takes as stopping point, and duration of that stop (s):
#: the move begins with its present speed.
_STOP_AHEAD, _STOP_DURATION = 1.0, 2.0

_PERIOD = 0.05  #: Period of the checks of vehicles that land (s).


def land_all(group: GroupState, is_checked: bool) -> dict[str, str]:
    """Land the vehicles of a group that fly; return why some have not landed: name to reason.

    Without a check vehicles land even if two come too near. See `crazyflie_fleet.landing_rounds`.
    """
    landing = _Landing(group, is_checked)
    landing.stop_moving()
    for _ in land_in_rounds(landing):
        group.clock.wait_until(never, group.time() + _PERIOD)
    return landing.failures


class _Landing(LandingSide):
    """The landing of the vehicles of a group."""

    def __init__(self, group: GroupState, is_checked: bool):
        self.failures: dict[str, str] = {}  #: Name to reason.
        self.arrival_timeout = group.rules.arrival_timeout
        self._group = group
        self._is_checked = is_checked
        # Vehicles that were commanded to land, and the planned end of their landing (s).
        self._descending: list[str] = []
        self._end = 0.0

    def stop_moving(self) -> None:
        """Stop the vehicles that move, and wait."""
        group, now = self._group, self.time()
        stops = {}
        for name in group.flying:
            trajectory = group._commanded[name]
            if trajectory.end > now:
                goal = trajectory.goal(now + _STOP_AHEAD)
                stops[name] = (goal.position, goal.yaw)
        if stops:
            self._move(stops, _STOP_DURATION)
            group.clock.wait_until(never, now + _STOP_DURATION)

    def _move(self, poses, duration):
        """Command positions (m) and yaws (rad); return the refusals, name to reason."""
        group, now = self._group, self.time()
        places = group._places()
        moves = {
            name: group._timed(name, straight(places[name], goal, yaw, yaw, duration), now)
            for name, (goal, yaw) in poses.items()
        }
        if self._is_checked:
            group._check_apart(moves, may_be_late=True)
        with group._commanding():
            calls = {
                name: group._vehicles[name].go_to(Move(goal, yaw, duration))
                for name, (goal, yaw) in poses.items()
            }
        failures = group._answers(calls)
        group._commanded.update({n: move for n, move in moves.items() if n not in failures})
        return failures

    @override
    def time(self) -> float:
        return self._group.time()

    @override
    def left(self) -> list[str]:
        done = {*self.failures, *self._descending}
        return [name for name in self._group.flying if name not in done]

    @override
    def is_busy(self) -> bool:
        is_late = self.time() >= self._end + self.arrival_timeout
        for name in [*self._descending]:
            vehicle = self._group._vehicles[name]
            if vehicle.has_landed():
                vehicle.stop()
                self._group.release(name)
            elif is_late:
                late = f"{self.arrival_timeout:g} s after it should be"
                self.failures[name] = f"not on the ground {late}"
            else:
                continue
            self._descending.remove(name)
        return bool(self._descending)

    @override
    def scene(self) -> tuple[Sequence[str], Scene]:
        group, left = self._group, self.left()
        obstacles = group.obstacles()
        places = group._places()
        places |= {name: o.position for name, o in obstacles.items() if o.position is not None}
        known = [*places]
        in_flight = {*group._commanded, *(name for name, o in obstacles.items() if o.is_flying)}
        fences = [
            EVERYWHERE if name in obstacles else group._all_vehicles[name].bounds for name in known
        ]
        fences = [fence.within(group.rules.bounds) for fence in fences]
        return known, Scene(
            np.array([*places.values()]),
            np.array([name in left for name in known]),
            np.array([name not in in_flight for name in known]),
            group.rules.clearance.limits(known),
            np.array([fence.lower[:2] for fence in fences]),
            np.array([fence.upper[:2] for fence in fences]),
        )

    @override
    def distance(self, name: str, goal: Place) -> float:
        place = self._group._vehicles[name].position()
        return math.inf if place is None else math.dist(place, goal)

    @override
    def go_aside(self, goals: Mapping[str, Place]) -> float:
        group, places = self._group, self._group._places()
        yaws = {name: group._commanded[name].goal(self.time()).yaw for name in goals}
        moves = (straight(places[name], goal) for name, goal in goals.items())
        duration = max(1.0, *map(group._shortest_duration, moves))
        poses = {name: (goal, yaws[name]) for name, goal in goals.items()}
        self.failures |= self._move(poses, duration)
        return self.time() + duration

    @override
    def descend(self, names: Sequence[str]) -> None:
        group, places = self._group, self._group._places()
        duration = max(_SHORTEST_LANDING, *(places[name][2] / _DESCENT_SPEED for name in names))
        descents = {}
        for name in names:
            x, y, _ = places[name]
            descent = straight(places[name], (x, y, 0.0), seconds=duration)
            descents[name] = TimedTrajectory(descent, self.time())
        if self._is_checked:
            group._check_apart(descents)
        # A vehicle that refuses does not keep the others in the air.
        with group._commanding():
            calls = {name: group._vehicles[name].land(None, duration) for name in names}
        refusals = group._answers(calls)
        self.failures |= refusals
        self._descending = [name for name in names if name not in refusals]
        group._commanded.update({name: descents[name] for name in self._descending})
        self._end = self.time() + duration

    @override
    def refuse(self, name: str, reason: str) -> None:
        self.failures[name] = reason
        place = self._group._places()[name]
        self._group._commanded[name] = TimedTrajectory.hover(place)
