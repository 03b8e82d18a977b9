"""A team's vehicles, and where they were told to be."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Self

from crazyflie_mission_api import trajectories
from crazyflie_mission_api.clearance import Clearance
from crazyflie_mission_api.course import Course, check_apart
from crazyflie_mission_api.limits import EVERYWHERE, Bounds, Limits, MissionError, number
from crazyflie_mission_api.vehicle import Clock, Vehicle, never


@dataclass(frozen=True)
class Rules:
    """What all commands of a mission keep to.

    Attributes
    ----------
    limits : Limits
        Of every vehicle.
    bounds : Bounds
        Of every vehicle; fences of their own count as well.
    separation : float
        Between any two vehicles in flight, m.
    tolerance : float
        How near to its goal a vehicle has arrived, m.
    patience : float
        How long a vehicle may take beyond what was planned, s.
    buffers : mapping of str to float
        Collision buffers of those whom a fleet process holds apart, m; see `Clearance`.
    """

    limits: Limits = field(default_factory=Limits)
    bounds: Bounds = EVERYWHERE
    separation: float = 0.3
    tolerance: float = 0.15
    patience: float = 15.0
    buffers: Mapping[str, float] = field(default_factory=dict)

    @property
    def clearance(self) -> Clearance:
        """How far apart vehicles have to be."""
        return Clearance(self.separation, self.buffers)

    def __post_init__(self) -> None:
        """Check the numbers."""
        number(self.separation, "separation", 0.0)
        number(self.tolerance, "tolerance", above=0.0)
        number(self.patience, "patience", 0.0)


class Roster:
    """The vehicles of a team, and where they were told to be.

    Parameters
    ----------
    vehicles : iterable of Vehicle
    clock : Clock
    rules : Rules, optional
    """

    def __init__(self, vehicles: Iterable[Vehicle], clock: Clock, rules: Rules | None = None):
        self._vehicles = {vehicle.name: vehicle for vehicle in vehicles}
        # The teams of some, too, have to keep apart from the others.
        self._everybody = self._vehicles
        self._clock = clock
        self.rules = rules or Rules()
        # Of all vehicles that fly; shared with the teams of some.
        self._courses: dict[str, Course] = {}

    def __getitem__(self, names: str | tuple[str, ...]) -> Self:
        """Return a team of some."""
        chosen = names if isinstance(names, tuple) else (names,)
        self._check_names(chosen)
        some = copy.copy(self)
        some._vehicles = {name: self._vehicles[name] for name in chosen}
        return some

    @property
    def names(self) -> list[str]:
        """Who is in the team."""
        return [*self._vehicles]

    @property
    def flying(self) -> list[str]:
        """Who of the team flies."""
        return [name for name in self._vehicles if name in self._courses]

    def time(self) -> float:
        """Return the time by which the vehicles live, s."""
        return self._clock.time()

    def position(self, name: str) -> tuple[float, float, float]:
        """Return where a vehicle is, m."""
        self._check_names([name])
        position = self._vehicles[name].position()
        if position is None:
            raise MissionError(f"{name}: nobody says where it is; expected motion capture or /tf")
        return position

    def fence(self, name: str) -> Bounds:
        """Return the box that a vehicle may fly in."""
        return self.rules.bounds.within(self._vehicles[name].bounds)

    def wait(self, seconds: float) -> None:
        """Let time pass, s, while the vehicles fly on."""
        self._wait(never, self.time() + number(seconds, "wait", 0.0))

    def arrive(self) -> None:
        """Wait until everybody is where it was told to be.

        Raises
        ------
        MissionError
            Somebody is not there, `Rules.patience` after it should be.
        """
        end = max((self._courses[name].end for name in self.flying), default=self.time())
        self._wait(never, end)
        if not self._wait(lambda: not self._late(), end + self.rules.patience):
            raise MissionError(
                f"{'; '.join(self._late())}: waited {self.rules.patience:g} s longer than planned; "
                f"expected {self.rules.tolerance:g} m at most"
            )

    def emergency(self) -> None:
        """Stop all motors at once, wherever the vehicles are: they fall."""
        failures = self._answers(lambda name: self._vehicles[name].emergency())
        for name in self._vehicles:
            if name not in failures:
                self._courses.pop(name, None)
        refuse("emergency", failures)

    # What commands have in common.

    def _quickest(self, way):
        return trajectories.duration(trajectories.within_limits(way, self.rules.limits))

    def _course(self, name, way, begin):
        return Course(way, begin, self._vehicles[name].start_skew)

    def _check_apart(self, courses):
        everybody = {**self._standing(), **self._courses, **courses}
        check_apart(everybody, self.time(), self.rules.clearance)

    def _standing(self):
        """Return the courses of the vehicles on the ground, as far as they are seen."""
        places = {
            name: vehicle.position()
            for name, vehicle in self._everybody.items()
            if name not in self._courses
        }
        return {name: Course.rest(place) for name, place in places.items() if place is not None}

    def _some(self, names):
        return self[tuple(names)]

    def _check_names(self, names):
        for name in names:
            if name not in self._vehicles:
                raise MissionError(
                    f"there is no vehicle {name!r}; expected one of {', '.join(self._vehicles)}"
                )

    def _tell(self, what, command):
        refuse(what, self._answers(command))

    def _answers(self, command):
        """Return why commands were refused: name to reason."""
        futures = {name: command(name) for name in self._vehicles}
        # Their limit is one of the machine's clock: simulated time may fly past a slow answer.
        self._clock.wait_until(lambda: all(f.done() for f in futures.values()), math.inf)
        errors = {name: future.exception() for name, future in futures.items()}
        return {name: str(error) for name, error in errors.items() if error is not None}

    def _wait(self, condition, deadline):
        self._clock.wait_until(lambda: condition() or bool(self._troubles()), deadline)
        if troubles := self._troubles():
            raise MissionError("; ".join(troubles))
        return condition()

    def _troubles(self):
        told = {name: self._vehicles[name].trouble() for name in self.flying}
        return [f"{name}: {why}" for name, why in told.items() if why]

    def _late(self):
        late = []
        for name in self.flying:
            goal = self._courses[name].destination.position
            distance = math.dist(self.position(name), goal)
            if distance > self.rules.tolerance:
                late.append(f"{name} is {distance:.2f} m from {text(goal)}")
        return late

    # The context of a flight.

    def __enter__(self) -> Self:
        """Begin a mission."""
        return self


def text(position: Iterable[float]) -> str:
    """Return a position as people write it, m."""
    return f"({', '.join(f'{value:.2f}' for value in position)})"


def refuse(what: str, failures: Mapping[str, str]) -> None:
    """Raise an error that names who has refused a command, and why; if anybody has."""
    if failures:
        raise MissionError("; ".join(f"{name}: {what}: {why}" for name, why in failures.items()))
