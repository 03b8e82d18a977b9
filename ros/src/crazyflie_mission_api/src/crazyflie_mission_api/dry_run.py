"""Ideal vehicles, and dry runs: missions of ideal vehicles, with the checks of a flight."""

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

from typing_extensions import override

from crazyflie_mission_api.group_state import Rules, text
from crazyflie_mission_api.limits import EVERYWHERE, Bounds, MissionError
from crazyflie_mission_api.mission_vehicle import (
    MEMORY,
    Clock,
    MissionVehicle,
    Move,
    Playback,
    Setpoint,
    done,
)
from crazyflie_mission_api.trajectories import TimedTrajectory
from crazyflie_mission_api.vehicle_group import VehicleGroup
from crazyflie_model.aerodynamics import Air
from crazyflie_model.angles import Triple
from crazyflie_model.planner import smooth_piece
from crazyflie_model.polynomials import Goal, PolynomialPiece, at_rest
from crazyflie_model.quadrotor import CRAZYFLIE
from crazyflie_model.trajectory import Pieces, Trajectory
from crazyflie_model.units import GRAVITY

_DEFINITIONS = 31  #: Number of trajectories that can be defined at one time.
_MIN_DURATION = 0.01  #: Shortest duration of a plan, as in the firmware (s).


class IdealVehicle(MissionVehicle):
    """A vehicle that follows the plans of the firmware's high-level commander without an error.

    ``time()`` returns the time, s. It begins on the ground, at a position (m) and yaw (rad).
    """

    def __init__(
        self,
        name: str,
        time: Callable[[], float],
        position: Triple,
        yaw: float = 0.0,
        bounds: Bounds = EVERYWHERE,
        start_skew: float = 0.0,
    ):
        self.name = name
        self.bounds = bounds
        self.start_skew = start_skew
        self.trajectory = TimedTrajectory.hover(position, yaw)  #: The plan, also after its end.
        self._time = time
        self._flies = False
        self.is_armed = True
        self.groups = 0  #: Mask of the groups that it belongs to.
        # The trajectory memory, and the place in it of each trajectory.
        self._memory: dict[int, PolynomialPiece] = {}
        self._rooms: dict[int, range] = {}
        self._prepared: Pieces = ()

    @property
    def is_active(self) -> bool:
        """Whether a plan keeps the motors running: in flight, or in a landing."""
        return self._flies or self._time() < self.trajectory.end

    def planned(self) -> Goal[float]:
        """Return the present goal of the plan, at which the next plan begins."""
        return self.trajectory.goal(self._time())

    @override
    def position(self) -> Triple:
        return self.planned().position

    @override
    def heading(self) -> float:
        return self.planned().yaw

    @override
    def fault(self) -> str:
        return ""

    @override
    def has_landed(self) -> bool:
        return not self.is_active

    @override
    def takeoff(self, height: float, duration: float, group_mask: int = 0) -> "Future[Any]":
        if not self._may_plan("takeoff", group_mask):
            return done(None)
        if self.is_active:
            self._warn(
                f"{self.name}.takeoff: the vehicle flies already; a real one ignores the command"
            )
            return done(None)
        return self._climb(height, duration, flies=True)

    @override
    def land(self, height: float | None, duration: float, group_mask: int = 0) -> "Future[Any]":
        is_landing = self.is_active and not self._flies
        if not self._may_plan("land", group_mask) or is_landing:
            return done(None)
        return self._climb(height or 0.0, duration, flies=False)

    @override
    def stop(self, group_mask: int = 0) -> "Future[Any]":
        if self._may_plan("stop", group_mask):
            self._stop_motors("stop")
        return done(None)

    @override
    def go_to(self, move: Move, group_mask: int = 0) -> "Future[Any]":
        if not self._may_plan("goTo", group_mask):
            return done(None)
        start, goal, yaw = self.planned(), move.goal, move.yaw
        if move.relative:
            x, y, z = (a + b for a, b in zip(goal, start.position, strict=True))
            goal, yaw = (x, y, z), yaw + start.yaw
        return self._fly([smooth_piece(start, goal, yaw, max(move.duration, _MIN_DURATION))])

    @override
    def prepare(self, pieces: Pieces, stream: bool) -> "Future[Any]":
        self._prepared = pieces
        return done(None)

    @override
    def start(self) -> "Future[Any]":
        return self._fly(self._prepared)

    @override
    def upload_trajectory(
        self, trajectory_id: int, piece_offset: int, pieces: Pieces
    ) -> "Future[Any]":
        # Trajectories have the ids of scripts, which go to 255; those of the firmware go to 30.
        where = f"{self.name}.uploadTrajectory"
        room = range(piece_offset, piece_offset + len(pieces))
        if room.stop > MEMORY:
            raise ValueError(
                f"{where}: {len(pieces)} pieces from pieceOffset {piece_offset} on; expected no "
                f"more than {MEMORY} in all, the room in the memory"
            )
        if trajectory_id not in self._rooms and len(self._rooms) >= _DEFINITIONS:
            raise ValueError(
                f"{where}: trajectoryId is {trajectory_id}; expected one of the {_DEFINITIONS} "
                f"that are in use: {sorted(self._rooms)}"
            )
        if trajectory_id >= _DEFINITIONS:
            self._warn(
                f"{where}: trajectoryId is {trajectory_id}; a real vehicle refuses it, the "
                f"firmware expects 0 to {_DEFINITIONS - 1}"
            )
        for other, taken in self._rooms.items():
            if other != trajectory_id and set(taken) & set(room):
                self._warn(
                    f"{where}: pieces {room.start} to {room.stop - 1} overwrite trajectory "
                    f"{other}; another pieceOffset keeps both"
                )
        self._rooms[trajectory_id] = room
        self._memory |= dict(zip(room, pieces, strict=True))
        return done(None)

    @override
    def start_trajectory(self, flight: Playback, group_mask: int = 0) -> "Future[Any]":
        if not self._may_plan("startTrajectory", group_mask):
            return done(None)
        if flight.number not in self._rooms:
            raise ValueError(
                f"{self.name}.startTrajectory: trajectoryId is {flight.number}; expected one that "
                f"uploadTrajectory has written: {sorted(self._rooms) or 'there is none'}"
            )
        pieces = [self._memory[place] for place in self._rooms[flight.number]]
        trajectory = Trajectory(pieces, flight.time_scale, flight.reverse)
        start = self.planned().position
        return self._fly(trajectory.moved_to(start, None) if flight.relative else trajectory)

    @override
    def set_group_mask(self, group_mask: int) -> "Future[Any]":
        self.groups = group_mask
        return done(None)

    @override
    def arm(self, arm: bool) -> "Future[Any]":
        self.is_armed = arm
        return done(None)

    @override
    def set_led_color(self, red: float, green: float, blue: float) -> "Future[Any]":
        return done(None)

    @override
    def send(self, setpoint: Setpoint) -> None:
        # The firmware's commander makes the planner forget its plan (commander.c).
        self._forget_plan()

    @override
    def notify_setpoints_stop(self, remain_valid_ms: int, group_mask: int = 0) -> "Future[Any]":
        return done(None)

    @override
    def emergency(self) -> "Future[Any]":
        x, y, _ = self.position()
        self._flies = False
        self.trajectory = TimedTrajectory.hover((x, y, 0.0))
        return done(None)

    def _may_plan(self, method: str, group_mask: int) -> bool:
        """Return whether a high-level command concerns this vehicle."""
        return group_mask == 0 or bool(group_mask & self.groups)

    def _warn(self, text: str) -> None:
        """Report a command that a real vehicle would not carry out."""

    def _stop_motors(self, method: str) -> None:
        """Stop at the present position."""
        self._forget_plan()

    def _forget_plan(self):
        start = self.planned()
        self._flies = False
        self.trajectory = TimedTrajectory.hover(start.position, start.yaw)

    def _climb(self, height, duration, flies):
        start = self.planned()
        (x, y, _), yaw = start.position, start.yaw
        duration = max(duration, _MIN_DURATION)
        piece = smooth_piece(at_rest(start.position, yaw), (x, y, height), yaw, duration)
        return self._fly([piece], flies)

    def _fly(self, plan: Pieces | Trajectory, flies: bool = True) -> "Future[Any]":
        self._flies = flies
        self.trajectory = TimedTrajectory(plan, self._time())
        return done(None)


_STEP = 0.05  #: Time step (s).
_LOOK_PERIOD = 0.2  #: Period at which the air between vehicles is looked at (s).
_WEIGHT = CRAZYFLIE.mass * GRAVITY  #: Thrust of a vehicle (N), of which type is not known here.
_FELT = 2.0  #: Speed of the air that changes the lift of a vehicle by 5 % (m/s).


class DryRunClock(Clock):
    """A clock whose time passes during waits only."""

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
        clock = DryRunClock(self._step)
        self._on_step = on_step
        self._air, self._next_look = Air(), 0.0
        # Vehicle -> the fastest air that others above it move: m/s, time (s) and place (m).
        self._downwash: dict[str, tuple[float, float, Triple]] = {}
        fences, yaws, skews = bounds or {}, headings or {}, start_skews or {}
        vehicles = []
        for name, position in starts.items():
            fence = fences.get(name, EVERYWHERE)
            yaw, skew = yaws.get(name, 0.0), skews.get(name, 0.0)
            vehicles.append(IdealVehicle(name, clock.time, position, yaw, fence, skew))
        super().__init__(vehicles, clock, rules)

    def stacked(self) -> list[str]:
        """Return a sentence for each vehicle that has flown in the downwash of others so far."""
        return [
            f"{name} flies below another vehicle: {time:.1f} s after the beginning, at "
            f"{text(place)} m, their downwash is {speed:.1f} m/s"
            for name, (speed, time, place) in self._downwash.items()
        ]

    def _step(self):
        self._on_step(self)
        if self.time() < self._next_look:
            return
        self._next_look = self.time() + _LOOK_PERIOD
        for name, vehicle in self._vehicles.items():
            place = self.position(name)
            flies = not vehicle.has_landed()
            speed = self._air.move(name, place, _WEIGHT if flies else 0.0)
            if flies and speed > self._downwash.get(name, (_FELT,))[0]:
                self._downwash[name] = speed, self.time(), place


def dry_run(group: VehicleGroup, mission: Callable[[VehicleGroup], Any]) -> float:
    """Fly ``mission(group)`` with ideal vehicles; return its duration, s.

    The group is on the ground. Commands of the mission must not depend on measurements.
    `MissionError`: the mission fails, or a vehicle is in flight.
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
    run.observer.begin = group.observer.plan  # type: ignore[method-assign]
    # Their present positions.
    obstacles = group.obstacles()
    run.obstacles = lambda: obstacles
    with run:
        mission(run)
    for each in run.stacked():
        group.warn(each)
    return run.time()
