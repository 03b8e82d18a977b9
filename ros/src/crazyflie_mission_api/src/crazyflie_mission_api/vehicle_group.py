"""Commands of missions to groups of vehicles, checked before vehicles move."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from crazyflie_mission_api import formations, trajectories
from crazyflie_mission_api.group_state import GroupState, raise_failures, text
from crazyflie_mission_api.landing import land_all
from crazyflie_mission_api.limits import Array, MissionError, number, point
from crazyflie_mission_api.mission_vehicle import Move
from crazyflie_mission_api.observer import command
from crazyflie_mission_api.trajectories import TimedTrajectory, straight
from crazyflie_model.trajectory import Pieces, duration, moved, stretched

Point = Sequence[float]

_SHORTEST_CLIMB = 2.0  #: Shortest duration of a takeoff (s).
_MIN_CLIMB = 0.1  #: Least height of a takeoff above the start (m).
_CLIMB_STEP = 0.1  #: Difference of the heights of a climb at which distances are checked (m).


class VehicleGroup(GroupState):
    """Vehicles that fly a mission; each command is for all of them.

    ``group["cf1"]`` and ``group["cf1", "cf2"]`` are subgroups, with the same commands. A command
    is checked as a whole before anything moves. It returns when it has been carried out; with
    ``wait=False`` when it has begun, and `arrive` waits.
    """

    @command
    def takeoff(self, height: float = 1.0, wait: bool = True) -> None:
        """Climb straight up to a height, m."""
        height = number(height, "takeoff: height", _MIN_CLIMB)
        climbs = {}
        for name in self._vehicles:
            if name in self._commanded:
                raise MissionError(
                    f"{name}: takeoff: the vehicle flies already; expected it on the ground"
                )
            x, y, z = self.position(name)
            if height < z + _MIN_CLIMB:
                raise MissionError(
                    f"{name}: takeoff: the height is {height:g} m, and the vehicle is at {z:.2f} "
                    f"m; expected at least {_MIN_CLIMB:g} m more, or the vehicle on the ground"
                )
            goal = (x, y, height)
            self.fence(name).check(np.array(goal), f"{name}: takeoff to {text(goal)}")
            heading = self._vehicles[name].heading()
            climb = straight((x, y, z), goal, heading, heading)
            climbs[name] = stretched(climb, max(_SHORTEST_CLIMB, self._shortest_duration(climb)))
        self._check_climbs(height)
        with self._commanding():
            # Stored first: vehicles that have begun to take off must be landed after any error.
            self._commanded.update({n: TimedTrajectory(c, self.time()) for n, c in climbs.items()})
            calls = {}
            for name, climb in climbs.items():
                vehicle = self._vehicles[name]
                calls[name] = vehicle.takeoff(height, duration(climb) + vehicle.takeoff_lead)
        failures = self._answers(calls)
        for name, climb in climbs.items():
            # A takeoff server answers after some time, before the height is reached.
            self._commanded[name] = TimedTrajectory(climb, self.time())
            if name in failures and self._vehicles[name].has_landed():
                del self._commanded[name]
        raise_failures("takeoff", failures)
        if wait:
            self.arrive()

    @command
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
            Goals and ``yaw`` are relative to the commanded pose of each vehicle.
        wait : bool
        """
        places = self._goals(goals, relative)
        starts = {name: self._destination(name, "go_to") for name in places}
        yaws = {name: start.yaw for name, start in starts.items()}
        if yaw is not None:
            added = number(yaw, "go_to: yaw")
            yaws = {name: added + relative * kept for name, kept in yaws.items()}
        moves = {
            name: straight(starts[name].position, goal, starts[name].yaw, yaws[name])
            for name, goal in places.items()
        }
        if duration is None:
            duration = max(1.0, *map(self._shortest_duration, moves.values()))
        seconds = number(duration, "go_to: duration", 1e-3)
        moves = {name: stretched(move, seconds) for name, move in moves.items()}
        self._check(moves, "go_to", "a longer duration")

        # Service calls take time: if possible, vehicles start by one message.
        prompt = [name for name in moves if self._vehicles[name].start_skew == 0.0]
        together = prompt if len(moves) > 1 else []
        self._prepare({name: moves[name] for name in together}, "go_to", stream=False)

        def begin():
            others = [name for name in moves if name not in together]
            calls = {n: self._vehicles[n].go_to(Move(places[n], yaws[n], seconds)) for n in others}
            return self._start(together) | calls

        self._fly(moves, "go_to", begin, wait)

    @command
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
            From `minimum_snap.plan`, or from a file of trajectories.
        timescale : float
            2 takes twice as long.
        relative : bool
            Move each to the commanded position of its vehicle; otherwise it must begin there.
        stream : bool
            Stream setpoints to a real vehicle; otherwise pieces are uploaded.
        wait : bool
        """
        factor = number(timescale, "follow: timescale", 1e-3)
        given = paths if isinstance(paths, Mapping) else dict.fromkeys(self._vehicles, paths)
        if not given:
            raise MissionError("follow: no trajectories are given; expected at least one")
        self._check_names(given)
        flown = {}
        for name, pieces in given.items():
            what = f"{name}: trajectory"
            trajectories.check_numbers(pieces, what)
            start = self._destination(name, "follow").position
            flown[name] = stretched(pieces, factor)
            first = flown[name][0].evaluate(0.0).position
            if relative:
                x, y, z = (a - b for a, b in zip(start, first, strict=True))
                flown[name] = moved(flown[name], (x, y, z))
            elif math.dist(first, start) > self.rules.tolerance:
                raise MissionError(
                    f"{what} begins at {text(first)}, {math.dist(first, start):.2f} m from the "
                    f"vehicle at {text(start)}; expected at most {self.rules.tolerance:g} m"
                )
        self._check(flown, "trajectory", "a timescale > 1")
        self._prepare(flown, "upload", stream)
        self._fly(flown, "follow", lambda: self._start(flown), wait)

    @command
    def formation(
        self, places: Array | Sequence[Point], duration: float | None = None, wait: bool = True
    ) -> dict[str, tuple[float, float, float]]:
        """Fly to places without collisions; return the place of each vehicle, m.

        The places, shape (n, 3), m, are as many as vehicles. For the others see `go_to`.
        """
        goals = [point(place, f"formation: place {k}") for k, place in enumerate(places, start=1)]
        if len(goals) != len(self._vehicles):
            raise MissionError(
                f"formation: the number of places is {len(goals)}; expected {len(self._vehicles)}, "
                "one for each vehicle"
            )
        starts = {name: self._destination(name, "formation").position for name in self._vehicles}
        chosen = formations.assign(starts, np.array(goals))
        self.go_to(chosen, duration=duration, wait=wait)
        return chosen

    @command
    def land(self) -> None:
        """Land, and wait until all vehicles are on the ground with their motors off.

        Vehicles land where they are, those below before those above them. Where another is beneath
        a vehicle, on the ground or in flight outside the group, it flies to the nearest free place
        first. `MissionError`: two vehicles would come too near, or some cannot land; the text names
        them.
        """
        raise_failures("land", land_all(self, is_checked=True))

    def __exit__(self, kind: type[BaseException] | None, error: Any, traceback: Any) -> None:
        """Land the vehicles that still fly, also after an error."""
        try:
            if self.flying and kind is None:
                self.land()
        finally:
            if self.flying:
                raise_failures("land", land_all(self, is_checked=False))

    # Common parts of commands.

    def _check_climbs(self, height):
        # Servers and vehicles decide the duration of a takeoff: the whole path must be free.
        starts = {name: self.position(name) for name in self._vehicles}
        highest = max(height - z for _, _, z in starts.values())
        for climb in np.linspace(0.0, highest, math.ceil(highest / _CLIMB_STEP) + 1).tolist():
            self._check_apart(
                {
                    name: TimedTrajectory.hover((x, y, min(z + climb, height)))
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
            raise MissionError("go_to: no goals are given; expected at least one")
        self._check_names(goals)
        places = {name: point(goal, f"{name}: goal") for name, goal in goals.items()}
        if relative:
            places = {
                name: goal + self._destination(name, "go_to").position
                for name, goal in places.items()
            }
        return {name: tuple(map(float, goal)) for name, goal in places.items()}

    def _destination(self, name, command):
        """Return the commanded goal of a vehicle that hovers."""
        if name not in self._commanded:
            raise MissionError(
                f"{name}: {command}: the vehicle is on the ground; call takeoff first"
            )
        left = self._commanded[name].end - self.time()
        if left > 0.0:
            raise MissionError(
                f"{name}: {command}: the vehicle is under way for another {left:.1f} s; call "
                "arrive() first"
            )
        return self._commanded[name].destination

    def _check(self, flown, what, slower):
        for name, pieces in flown.items():
            fence = self.fence(name)
            trajectories.check(pieces, self.rules.limits, fence, f"{name}: {what}", slower)
        now = self.time()
        timed = {name: self._timed(name, pieces, now) for name, pieces in flown.items()}
        self._check_apart(timed, may_be_late=True)

    def _prepare(self, flown, what, stream):
        with self._commanding():
            vehicles = self._vehicles
            calls = {name: vehicles[name].prepare(each, stream) for name, each in flown.items()}
        raise_failures(what, self._answers(calls))

    def _start(self, names):
        """Start the trajectories that were prepared last; return the futures of the answers."""
        return {name: self._vehicles[name].start() for name in names}

    def _fly(self, flown, what, call, wait):
        begin = self.time()
        with self._commanding():
            calls = call()
        failures = self._answers(calls)
        for name, pieces in flown.items():
            if name not in failures:
                self._commanded[name] = self._timed(name, pieces, begin)
        raise_failures(what, failures)
        if wait:
            self[tuple(flown)].arrive()
