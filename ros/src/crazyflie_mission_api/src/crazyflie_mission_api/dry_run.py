"""Dry runs: missions of ideal vehicles, with the checks of a flight, without waiting."""

from collections.abc import Callable, Mapping
from typing import Any

from typing_extensions import override

from crazyflie_mission_api.group_state import Rules
from crazyflie_mission_api.ideal_vehicle import IdealVehicle
from crazyflie_mission_api.limits import EVERYWHERE, Bounds, MissionError
from crazyflie_mission_api.mission_vehicle import Clock
from crazyflie_mission_api.vehicle_group import VehicleGroup
from crazyflie_model.angles import Triple

_STEP = 0.05  #: Time step (s).


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


class DryRun(VehicleGroup):
    """A group of ideal vehicles.

    Mappings by vehicle name: ``starts``, positions before takeoff, m; fences (``bounds``);
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
            vehicles.append(IdealVehicle(name, clock.time, position, yaw, fence, skew))
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
