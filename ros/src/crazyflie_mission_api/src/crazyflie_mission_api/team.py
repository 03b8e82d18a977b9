"""Missions: what a script says to vehicles, checked before they move."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from crazyflie_mission_api import formations, trajectories
from crazyflie_mission_api.course import Course, check_starts
from crazyflie_mission_api.landing import LandingTeam
from crazyflie_mission_api.limits import Array, MissionError, number, point
from crazyflie_mission_api.roster import refuse, text
from crazyflie_mission_api.trajectories import Pieces

Point = Sequence[float]

_SHORTEST_CLIMB = 2.0
"""s."""

_LEAST_CLIMB = 0.1
"""How high a takeoff goes at least, m."""

_CLIMB_STEP = 0.1
"""From one height of a climb at which distances are looked at to the next, m."""


class Team(LandingTeam):
    """Vehicles that fly a mission; each command is for all of them.

    ``team["cf1"]`` and ``team["cf1", "cf2"]`` are teams of some, with the same commands. A
    command is checked as a whole before anything moves. It returns when it has been carried out;
    with ``wait=False`` when it has begun, and `arrive` waits.
    """

    # Commands.

    def takeoff(self, height: float = 1.0, wait: bool = True) -> None:
        """Climb straight up to a height, m."""
        height = number(height, "takeoff: height", _LEAST_CLIMB)
        ways = {}
        for name in self._vehicles:
            if name in self._courses:
                raise MissionError(f"{name}: takeoff: it flies already; expected it on the ground")
            x, y, z = self.position(name)
            if height < z + _LEAST_CLIMB:
                raise MissionError(
                    f"{name}: takeoff: the height is {height:g} m, and it is at {z:.2f} m; "
                    f"expected at least {_LEAST_CLIMB:g} m more"
                )
            goal = (x, y, height)
            self.fence(name).check(np.array(goal), f"{name}: takeoff to {text(goal)}")
            heading = self._vehicles[name].heading()
            way = trajectories.straight((x, y, z), goal, heading, heading)
            climb = max(_SHORTEST_CLIMB, self._quickest(way))
            ways[name] = trajectories.stretched(way, climb)
        self._check_climbs(height)
        # Noted first: what has begun to take off must be landed whatever happens.
        self._courses.update({name: Course(way, self.time()) for name, way in ways.items()})

        def take_off(name):
            return self._vehicles[name].take_off(height, trajectories.duration(ways[name]))

        failures = self._answers(take_off)
        for name, way in ways.items():
            # A takeoff server answers after some time, with the height still to be reached.
            self._courses[name] = Course(way, self.time())
            if name in failures and self._vehicles[name].has_landed():
                del self._courses[name]
        refuse("takeoff", failures)
        if wait:
            self.arrive()

    def go_to(
        self,
        goals: Point | Mapping[str, Point],
        yaw: float | None = None,
        duration: float | None = None,
        relative: bool = False,
        wait: bool = True,
    ) -> None:
        """Fly straight to points, all in the same time.

        Parameters
        ----------
        goals : x, y, z, or mapping of str to x, y, z
            m; for several vehicles by name. One point for several of them only if relative.
        yaw : float, optional
            rad; by default each vehicle keeps its own.
        duration : float, optional
            s; by default as short as the limits allow.
        relative : bool
            Goals and ``yaw`` count from where each vehicle was told to be.
        wait : bool
        """
        places = self._goals(goals, relative)
        starts = {name: self._rest_of(name, "go_to") for name in places}
        yaws = {name: start.yaw for name, start in starts.items()}
        if yaw is not None:
            told = number(yaw, "go_to: yaw")
            yaws = {name: told + relative * kept for name, kept in yaws.items()}
        ways = {
            name: trajectories.straight(starts[name].position, goal, starts[name].yaw, yaws[name])
            for name, goal in places.items()
        }
        if duration is None:
            shortest = (self._quickest(way) for way in ways.values())
            duration = max(1.0, *shortest)
        seconds = number(duration, "go_to: duration", 1e-3)
        ways = {name: trajectories.stretched(way, seconds) for name, way in ways.items()}
        self._check(ways, "go_to", "a longer duration")

        # Calls take their time, and who begins later meets others.
        prompt = [name for name in ways if self._vehicles[name].start_skew == 0.0]
        together = prompt if len(ways) > 1 else []
        chosen = self._some(together)
        chosen._tell("go_to", lambda name: self._vehicles[name].prepare(ways[name], False))

        def command(name):
            if name in together:
                return self._vehicles[name].start()
            return self._vehicles[name].go_to(places[name], yaws[name], seconds)

        self._fly(ways, "go_to", command, wait)

    def follow(
        self,
        paths: Pieces | Mapping[str, Pieces],
        timescale: float = 1.0,
        relative: bool = False,
        stream: bool = False,
        wait: bool = True,
    ) -> None:
        """Fly along trajectories, which all begin at the same time.

        Parameters
        ----------
        paths : sequence of PolynomialPiece, or mapping of str to such
            As `minimum_snap.plan` and files of trajectories have them.
        timescale : float
            2 takes twice as long.
        relative : bool
            As if it began where the vehicle was told to be; otherwise it has to begin there.
        stream : bool
            Send a real vehicle setpoint by setpoint; otherwise pieces are uploaded.
        wait : bool
        """
        factor = number(timescale, "follow: timescale", 1e-3)
        given = paths if isinstance(paths, Mapping) else dict.fromkeys(self._vehicles, paths)
        if not given:
            raise MissionError("follow: there are no trajectories; expected one at least")
        self._check_names(given)
        ways = {}
        for name, pieces in given.items():
            what = f"{name}: trajectory"
            trajectories.check_numbers(pieces, what)
            start = self._rest_of(name, "follow").position
            way = trajectories.stretched(pieces, factor)
            first = way[0].evaluate(0.0).position
            if relative:
                offset = [a - b for a, b in zip(start, first, strict=True)]
                way = trajectories.moved(way, offset)
            elif math.dist(first, start) > self.rules.tolerance:
                raise MissionError(
                    f"{what} begins at {text(first)}, {math.dist(first, start):.2f} m from where "
                    f"the vehicle is, {text(start)}; expected at most {self.rules.tolerance:g} m"
                )
            ways[name] = way
        self._check(ways, "trajectory", "a timescale > 1")
        chosen = self._some(ways)
        chosen._tell("upload", lambda name: self._vehicles[name].prepare(ways[name], stream))
        self._fly(ways, "follow", lambda name: self._vehicles[name].start(), wait)

    def formation(
        self, places: Array | Sequence[Point], duration: float | None = None, wait: bool = True
    ) -> dict[str, tuple[float, float, float]]:
        """Fly to places in a way that nobody meets; return who has gone where.

        Parameters
        ----------
        places : array_like, shape (n, 3)
            As many as vehicles, m.
        duration, wait
            As for `go_to`.
        """
        goals = [point(place, f"formation: place {k}") for k, place in enumerate(places, start=1)]
        if len(goals) != len(self._vehicles):
            raise MissionError(
                f"formation: the number of places is {len(goals)}; expected {len(self._vehicles)}, "
                "one for each vehicle"
            )
        starts = {name: self._rest_of(name, "formation").position for name in self._vehicles}
        chosen = formations.assign(starts, np.array(goals))
        self.go_to(chosen, duration=duration, wait=wait)
        return chosen

    # What commands have in common.

    def _check_climbs(self, height):
        # How long a takeoff takes, servers and vehicles decide: all of the way has to be free.
        starts = {name: self.position(name) for name in self._vehicles}
        highest = max(height - z for _, _, z in starts.values())
        for climb in np.linspace(0.0, highest, math.ceil(highest / _CLIMB_STEP) + 1).tolist():
            self._check_apart(
                {
                    name: Course.rest((x, y, min(z + climb, height)))
                    for name, (x, y, z) in starts.items()
                }
            )

    def _goals(self, goals, relative):
        if not isinstance(goals, Mapping):
            if len(self._vehicles) > 1 and not relative:
                raise MissionError(
                    f"go_to: one goal {goals!r} for {len(self._vehicles)} vehicles; expected "
                    "a goal for each: {name: (x, y, z)}"
                )
            goals = dict.fromkeys(self._vehicles, goals)
        if not goals:
            raise MissionError("go_to: there are no goals; expected one at least")
        self._check_names(goals)
        places = {name: point(goal, f"{name}: goal") for name, goal in goals.items()}
        if relative:
            places = {
                name: goal + self._rest_of(name, "go_to").position for name, goal in places.items()
            }
        return {name: tuple(map(float, goal)) for name, goal in places.items()}

    def _rest_of(self, name, command):
        if name not in self._courses:
            raise MissionError(f"{name}: {command}: it is on the ground; expected takeoff before")
        left = self._courses[name].end - self.time()
        if left > 0.0:
            raise MissionError(
                f"{name}: {command}: it is on its way for another {left:.1f} s; expected arrive() "
                "before"
            )
        return self._courses[name].destination

    def _check(self, ways, what, slower):
        for name, way in ways.items():
            trajectories.check(way, self.rules.limits, self.fence(name), f"{name}: {what}", slower)
        now = self.time()
        begun = {name: self._course(name, way, now) for name, way in ways.items()}
        check_starts({**self._courses, **begun}, now, self._check_apart)

    def _fly(self, ways, what, command, wait):
        team = self._some(ways)
        begin = self.time()
        failures = team._answers(command)
        for name, way in ways.items():
            if name not in failures:
                self._courses[name] = self._course(name, way, begin)
        refuse(what, failures)
        if wait:
            team.arrive()
