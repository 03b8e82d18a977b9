"""The vehicles of a group and their commanded trajectories."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import NamedTuple, Self

from crazyflie_mission_api.limits import EVERYWHERE, Bounds, Clearance, Limits, MissionError, number
from crazyflie_mission_api.mission_vehicle import Clock, MissionVehicle, never
from crazyflie_mission_api.observer import MissionObserver, command
from crazyflie_mission_api.trajectories import TimedTrajectory, check_apart, within_limits
from crazyflie_model import trajectory
from crazyflie_model.angles import Triple


@dataclass(frozen=True)
class Rules:
    """Limits of all commands of a mission."""

    limits: Limits = field(default_factory=Limits)  # Limits of every vehicle.
    bounds: Bounds = EVERYWHERE  # Box of every vehicle; its own fence limits it, too.
    separation: float = 0.3  # Distance between any two vehicles in flight (m).
    tolerance: float = 0.15  # Distance from the goal at which a vehicle has arrived (m).
    arrival_timeout: float = 15.0  # Longest time of a vehicle beyond the planned duration (s).
    # Collision buffers of vehicles that a fleet process keeps apart (m); see `Clearance`.
    buffers: Mapping[str, float] = field(default_factory=dict)

    @property
    def clearance(self) -> Clearance:
        """Distances between vehicles."""
        return Clearance(self.separation, self.buffers)

    def __post_init__(self) -> None:
        number(self.separation, "separation", 0.0)
        number(self.tolerance, "tolerance", above=0.0)
        number(self.arrival_timeout, "arrival_timeout", 0.0)


class Obstacle(NamedTuple):
    """A vehicle of another mission."""

    position: Triple | None  #: Position (m); None if it is not known.
    is_flying: bool


class GroupState:
    """Vehicles and their commanded trajectories."""

    def __init__(
        self, vehicles: Iterable[MissionVehicle], clock: Clock, rules: Rules | None = None
    ):
        self._vehicles = {vehicle.name: vehicle for vehicle in vehicles}
        # Subgroups also keep apart from all vehicles.
        self._all_vehicles = self._vehicles
        self.clock = clock
        self.rules = rules or Rules()
        # Trajectories of all vehicles in flight; shared with subgroups.
        self._commanded: dict[str, TimedTrajectory] = {}
        self.observer = MissionObserver()  #: Called at each command.
        #: Returns the vehicles of other missions, by name.
        self.obstacles: Callable[[], Mapping[str, Obstacle]] = dict

    def __getitem__(self, names: str | tuple[str, ...]) -> Self:
        """Return a subgroup."""
        chosen = names if isinstance(names, tuple) else (names,)
        self._check_names(chosen)
        subgroup = copy.copy(self)
        subgroup._vehicles = {name: self._vehicles[name] for name in chosen}
        return subgroup

    def __enter__(self) -> Self:
        return self

    @property
    def names(self) -> list[str]:
        """Names of the vehicles."""
        return [*self._vehicles]

    @property
    def flying(self) -> list[str]:
        """Names of the vehicles in flight."""
        return [name for name in self._vehicles if name in self._commanded]

    def adopt(self, name: str) -> None:
        """Register a vehicle that flies by other commands: it is landed at the end."""
        place = self._vehicles[name].position() or (0.0, 0.0, 0.0)
        self._commanded[name] = TimedTrajectory.hover(place)

    def release(self, name: str) -> None:
        """Unregister an adopted vehicle that has landed."""
        self._commanded.pop(name, None)

    def time(self) -> float:
        """Return the time of the vehicles, s."""
        return self.clock.time()

    def position(self, name: str) -> tuple[float, float, float]:
        """Return the position of a vehicle, m."""
        self._check_names([name])
        position = self._vehicles[name].position()
        if position is None:
            raise MissionError(f"{name}: its position is not known; expected motion capture or /tf")
        return position

    def fence(self, name: str) -> Bounds:
        """Return the box that a vehicle may fly in."""
        return self.rules.bounds.within(self._vehicles[name].bounds)

    @command
    def wait(self, seconds: float) -> None:
        """Wait, s, while the vehicles fly on."""
        self._wait(never, self.time() + number(seconds, "wait", 0.0))

    def arrive(self) -> None:
        """Wait until all vehicles are at their commanded destinations.

        `MissionError`: a vehicle has not arrived `Rules.arrival_timeout` after the planned end.
        """
        end = max((self._commanded[name].end for name in self.flying), default=self.time())
        self._wait(never, end)
        if not self._wait(lambda: not self._late(), end + self.rules.arrival_timeout):
            raise MissionError(
                f"{'; '.join(self._late())}: waited {self.rules.arrival_timeout:g} s longer than "
                f"planned; expected {self.rules.tolerance:g} m at most"
            )

    @command
    def set_led_color(self, red: float, green: float, blue: float) -> None:
        """Light LED rings and Color LED decks, 0 to 1 each; simulated vehicles have none."""
        parts = {"red": red, "green": green, "blue": blue}
        color = [
            number(value, f"set_led_color: {name}", minimum=0.0, maximum=1.0)
            for name, value in parts.items()
        ]
        calls = {name: each.set_led_color(*color) for name, each in self._vehicles.items()}
        raise_failures("set_led_color", self._answers(calls))

    @command
    def emergency(self) -> None:
        """Stop all motors at once, wherever the vehicles are: they fall."""
        failures = self._answers({name: v.emergency() for name, v in self._vehicles.items()})
        for name in self._vehicles.keys() - failures.keys():
            self._commanded.pop(name, None)
        raise_failures("emergency", failures)

    # Common parts of commands.

    def _commanding(self) -> AbstractContextManager[None]:
        """Return a context in which a command is sent; entering it may raise `MissionError`."""
        return nullcontext()

    def _shortest_duration(self, pieces):
        return trajectory.duration(within_limits(pieces, self.rules.limits))

    def warn(self, text: str) -> None:
        """Report what a dry run has found that is not an error."""
        self.observer.warn(text)

    def _timed(self, name, pieces, begin):
        return TimedTrajectory(pieces, begin, self._vehicles[name].start_skew)

    def _places(self) -> dict[str, Triple]:
        """Return the positions of all vehicles: name to m."""
        places: dict[str, Triple] = {}
        for name, vehicle in self._all_vehicles.items():
            measured = vehicle.position()
            if name in self._commanded:
                # Commanded positions were checked; a vehicle away from its commanded position has
                # the measured one.
                places[name] = commanded = self._commanded[name].goal(self.time()).position
                if measured is None or math.dist(measured, commanded) <= self.rules.tolerance:
                    continue
            if measured is not None:
                places[name] = measured
        return places

    def _check_apart(self, changed, may_be_late=False):
        """Check trajectories together with those of all other vehicles.

        Vehicles of other missions have fixed positions: their missions check them among each other.
        """
        on_ground = {
            name: vehicle.position()
            for name, vehicle in self._all_vehicles.items()
            if name not in self._commanded
        }
        for name, obstacle in self.obstacles().items():
            on_ground[name] = obstacle.position
            if obstacle.is_flying and obstacle.position is None:
                raise MissionError(
                    f"{name}: its position is not known, and another mission flies it; its "
                    "distance cannot be checked"
                )
        resting = {name: TimedTrajectory.hover(p) for name, p in on_ground.items() if p is not None}
        everything = {**resting, **self._commanded, **changed}
        at_rest = resting.keys() - changed.keys()
        check_apart(everything, self.time(), self.rules.clearance, at_rest, may_be_late)

    def _check_names(self, names):
        for name in names:
            if name not in self._vehicles:
                raise MissionError(
                    f"no vehicle has the name {name!r}; expected one of {', '.join(self._vehicles)}"
                )

    def _answers(self, futures):
        """Wait for the answers to commands; return why some were refused: name to reason."""
        # Their timeout is by the machine's clock: simulated time may run faster than a slow answer.
        self.clock.wait_until(lambda: all(f.done() for f in futures.values()), math.inf)
        errors = {name: future.exception() for name, future in futures.items()}
        return {name: str(error) for name, error in errors.items() if error is not None}

    def _wait(self, condition, deadline):
        self.clock.wait_until(lambda: condition() or bool(self._faults()), deadline)
        if faults := self._faults():
            raise MissionError("; ".join(faults))
        return condition()

    def _faults(self):
        faults = {name: self._vehicles[name].fault() for name in self.flying}
        return [f"{name}: {fault}" for name, fault in faults.items() if fault]

    def _late(self):
        late = []
        for name in self.flying:
            goal = self._commanded[name].destination.position
            distance = math.dist(self.position(name), goal)
            if distance > self.rules.tolerance:
                late.append(f"{name} is {distance:.2f} m from {text(goal)}")
        return late


def text(position: Iterable[float]) -> str:
    """Return a position (m) as text."""
    return f"({', '.join(f'{value:.2f}' for value in position)})"


def raise_failures(what: str, failures: Mapping[str, str]) -> None:
    """Raise an error that names each vehicle that has refused a command, and its reason."""
    if failures:
        raise MissionError("; ".join(f"{name}: {what}: {why}" for name, why in failures.items()))
