"""Keeps the vehicles of a script that the driver alone flies apart, as a fleet does."""

import math
from collections.abc import Sequence

import numpy as np

from crazyflie_fleet.separation import LOOK_AHEAD, Separation
from crazyflie_mission_api.ros_vehicle import TimedPose, velocity_between
from crazyflie_py.script_vehicle import ScriptConnection, ScriptVehicle

_SHORTEST_SPAN = 0.02  #: Least time between two poses for a velocity (s).
_LONGEST_SPAN = 0.3  #: Age of the first pose above which it is not used for a velocity (s).
_LOWEST_SPEED = 0.05  #: Speed below which a vehicle hovers (m/s).
_REPEAT = 2.0  #: Shortest time between two warnings of a vehicle (s).


class SeparationWatch:
    """Holds vehicles that come too near to another, by the rule of a fleet.

    The goal of a vehicle without setpoints follows from its velocity. ``buffers`` are the radii of
    the space that is reserved for each vehicle, m. If the connection is unchecked, there are only
    warnings.
    """

    def __init__(
        self,
        vehicles: Sequence[ScriptVehicle],
        buffers: Sequence[float],
        connection: ScriptConnection,
    ):
        self._vehicles = vehicles
        self._separation = Separation(buffers)
        self._connection = connection
        self._poses: list[TimedPose | None] = [None] * len(vehicles)
        self._velocities = np.zeros((len(vehicles), 3))
        self._held: set[int] = set()

    def update(self) -> None:
        """Check all vehicles, and hold or release them."""
        positions = np.full((len(self._vehicles), 3), math.nan)
        goals = positions.copy()
        for k, vehicle in enumerate(self._vehicles):
            pose = vehicle.pose()
            self._measure(k, pose)
            if pose is not None:
                positions[k] = pose.position
                streamed = vehicle.streamed_goal(pose.position)
                ahead = positions[k] + LOOK_AHEAD * self._velocities[k]
                goals[k] = ahead if streamed is None else streamed
        approaching, pairs = self._separation.update(positions, self._velocities, goals)
        held = {int(k) for k in np.flatnonzero(approaching) if self._vehicles[int(k)].may_be_held}
        for k in sorted(held - self._held):
            self._begin(k, pairs, positions[k])
        for k in self._held - held:
            self._vehicles[k].release()
        self._held = held

    def _measure(self, k, pose):
        last = self._poses[k]
        span = math.inf if pose is None or last is None else pose.time - last.time
        if 0.0 <= span < _SHORTEST_SPAN:
            return
        self._poses[k] = pose
        self._velocities[k] = 0.0
        if 0.0 < span <= _LONGEST_SPAN:
            velocity = velocity_between(last, pose)
            if np.linalg.norm(velocity) > _LOWEST_SPEED:
                self._velocities[k] = velocity

    def _begin(self, k, pairs, position):
        (pair, *_) = [pair for pair in pairs if k in pair[:2]]
        other = self._vehicles[pair.second if pair.first == k else pair.first]
        x, y, z = position.tolist()
        is_held = not self._connection.is_unchecked
        self._connection.handle.warn(
            f"{self._vehicles[k].name} comes too near to {other.name}, now or in {LOOK_AHEAD:g} "
            f"s: {pair.distance:.2f} m; expected at least {pair.limit:.2f} m (vertical distances "
            f"are halved); {'the vehicle is held' if is_held else 'the vehicle flies on'}",
            throttle=_REPEAT,
            key=f"separation {self._vehicles[k].name}",
        )
        if is_held:
            self._vehicles[k].hold((x, y, z))
