"""Dry runs: missions of ideal vehicles, with the checks of a flight, in no time."""

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from typing_extensions import override

from crazyflie_mission_api.group_state import Rules
from crazyflie_mission_api.limits import EVERYWHERE, Bounds, MissionError
from crazyflie_mission_api.mission_vehicle import Clock, MissionVehicle, done
from crazyflie_mission_api.trajectories import TimedTrajectory, straight
from crazyflie_mission_api.vehicle_group import VehicleGroup
from crazyflie_model.angles import Triple
from crazyflie_model.trajectory import Pieces

_STEP = 0.05  #: Of time, s.


class DryRunClock(Clock):
    """Time that passes during waits only."""

    def __init__(self, on_step: Callable[[], None] = lambda: None):
        self._time = 0.0
        self._on_step = on_step

    @override
    def time(self) -> float:
        return self._time

    @override
    def wait_until(self, condition: Callable[[], bool], deadline: float) -> bool:
        while not (is_met := condition()) and self._time < deadline:
            self._on_step()
            self._time = min(self._time + _STEP, deadline)
        return is_met


@dataclass(eq=False)
class IdealVehicle(MissionVehicle):
    """A vehicle that is always at its commanded position; `start_skew` is the real one's."""

    name: str
    bounds: Bounds
    start_skew: float
    clock: Clock
    trajectory: TimedTrajectory
    _prepared: Pieces = ()
    _flies: bool = False

    def _goal(self):
        return self.trajectory.goal(self.clock.time())

    @override
    def position(self) -> Triple:
        return self._goal().position

    @override
    def heading(self) -> float:
        return self._goal().yaw

    @override
    def fault(self) -> str:
        return ""

    @override
    def has_landed(self) -> bool:
        return not self._flies and self.clock.time() >= self.trajectory.end

    @override
    def take_off(self, height: float, duration: float) -> "Future[Any]":
        self._flies = True
        x, y, _ = self.position()
        return self.go_to((x, y, height), self.heading(), duration)

    @override
    def land(self, duration: float) -> "Future[Any]":
        self._flies = False
        x, y, _ = self.position()
        return self.go_to((x, y, 0.0), self.heading(), duration)

    @override
    def stop_motors(self) -> None:
        pass

    @override
    def go_to(self, goal: Triple, yaw: float, duration: float) -> "Future[Any]":
        start = self._goal()
        return self._fly(straight(start.position, goal, start.yaw, yaw, duration))

    @override
    def prepare(self, pieces: Pieces, stream: bool) -> "Future[Any]":
        self._prepared = pieces
        return done(None)

    @override
    def start(self) -> "Future[Any]":
        return self._fly(self._prepared)

    @override
    def emergency(self) -> "Future[Any]":
        x, y, _ = self.position()
        self._flies = False
        self.trajectory = TimedTrajectory.hover((x, y, 0.0))
        return done(None)

    def _fly(self, pieces):
        self.trajectory = TimedTrajectory(pieces, self.clock.time())
        return done(None)


class DryRun(VehicleGroup):
    """A group of ideal vehicles.

    By the names of vehicles: ``starts``, positions before takeoff, m; fences (``bounds``);
    ``headings``, rad, 0 by default; ``start_skews``, s, 0 by default. ``on_step(group)`` is called
    whenever time passes.
    """

    def __init__(
        self,
        starts: Mapping[str, Triple],
        rules: Rules | None = None,
        bounds: Mapping[str, Bounds] | None = None,
        headings: Mapping[str, float] | None = None,
        start_skews: Mapping[str, float] | None = None,
        on_step: Callable[[VehicleGroup], None] = lambda group: None,
    ):
        clock = DryRunClock(lambda: on_step(self))
        fences, yaws, skews = bounds or {}, headings or {}, start_skews or {}
        vehicles = []
        for name, position in starts.items():
            fence = fences.get(name, EVERYWHERE)
            yaw, skew = yaws.get(name, 0.0), skews.get(name, 0.0)
            hover = TimedTrajectory.hover(position, yaw)
            vehicles.append(IdealVehicle(name, fence, skew, clock, hover))
        super().__init__(vehicles, clock, rules)


def dry_run(group: VehicleGroup, mission: Callable[[VehicleGroup], Any]) -> float:
    """Fly ``mission(group)`` with ideal vehicles; return its duration, s.

    The group is on the ground. Commands of the mission must not depend on measurements.

    Raises
    ------
    MissionError
        The mission fails, or a vehicle is in flight.
    """
    if group.flying:
        raise MissionError(f"{', '.join(group.flying)}: in flight; expected to be on the ground")
    run = DryRun(
        {name: group.position(name) for name in group.names},
        group.rules,
        {name: group.fence(name) for name in group.names},
        {name: vehicle.heading() for name, vehicle in group._vehicles.items()},
        {name: vehicle.start_skew for name, vehicle in group._vehicles.items()},
        group.observer.step,
    )
    # Where they are now.
    obstacles = group.obstacles()
    run.obstacles = lambda: obstacles
    with run:
        mission(run)
    return run.time()
