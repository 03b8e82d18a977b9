"""A vehicle that follows its plan without an error: for dry runs and Crazyswarm's --sim."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from typing_extensions import override

from crazyflie_mission_api.limits import EVERYWHERE, Bounds
from crazyflie_mission_api.mission_vehicle import MissionVehicle, done
from crazyflie_mission_api.trajectories import TimedTrajectory
from crazyflie_model.angles import Triple
from crazyflie_model.planner import smooth_piece
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_model.trajectory import Pieces, Trajectory

_MIN_DURATION = 0.01  #: Shortest duration of a plan, as in the firmware (s).


class IdealVehicle(MissionVehicle):
    """A vehicle that follows the plans of the firmware's high-level commander without an error.

    Parameters
    ----------
    name : str
    time : callable
        Returns the time, s.
    position : tuple, 3 components
        Position at the beginning, on the ground, m.
    yaw : float
        rad.
    bounds, start_skew
        Those of the real one.
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
    def take_off(self, height: float, duration: float, group_mask: int = 0) -> "Future[Any]":
        return self._climb(height, duration, flies=True)

    @override
    def land(self, height: float | None, duration: float, group_mask: int = 0) -> "Future[Any]":
        return self._climb(height or 0.0, duration, flies=False)

    @override
    def stop(self, group_mask: int = 0) -> "Future[Any]":
        start = self.planned()
        self._flies = False
        self.trajectory = TimedTrajectory.hover(start.position, start.yaw)
        return done(None)

    @override
    def go_to(
        self,
        goal: Triple,
        yaw: float,
        duration: float,
        relative: bool = False,
        group_mask: int = 0,
    ) -> "Future[Any]":
        start = self.planned()
        if relative:
            x, y, z = (a + b for a, b in zip(goal, start.position, strict=True))
            goal, yaw = (x, y, z), yaw + start.yaw
        piece = smooth_piece(start, goal, yaw, max(duration, _MIN_DURATION))
        return self._fly([piece])

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
