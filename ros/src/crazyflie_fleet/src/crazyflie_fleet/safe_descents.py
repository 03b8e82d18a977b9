"""Descents that lead beside the vehicles beneath, and not onto them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crazyflie_fleet.landing import free_place
from crazyflie_fleet.straight_move import shortest_duration
from crazyflie_model.trajectory import minimum_jerk

_MARGIN = 1.1  #: Duration of the move sideways, in the shortest possible ones.
_MAX_GAP = 0.5  #: Between two references of one descent, s.


@dataclass
class _Descent:
    """A move from a start (x, y, z) to a landing place (x, y), m; times are in s."""

    start: NDArray[np.float64]
    place: NDArray[np.float64]
    duration: float
    begin: float
    last: float


class SafeDescents:
    """Landing places of vehicles that descend.

    A vehicle with another beneath it flies to the nearest free place while it sinks. ``buffers``
    are the collision buffers of all vehicles, m.
    """

    def __init__(self, buffers: Sequence[float]):
        radii = np.array(buffers, dtype=float)
        self._limits = radii[:, None] + radii
        self._descents: dict[int, _Descent] = {}

    def is_under_way(self, number: int, time: float) -> bool:
        """Return whether a reference at a time (s) belongs to the present descent of a vehicle."""
        descent = self._descents.get(number)
        return descent is not None and 0.0 <= time - descent.last < _MAX_GAP

    def begin(
        self,
        number: int,
        time: float,
        positions: NDArray[np.float64],
        is_landing: NDArray[np.bool_],
    ) -> float:
        """Choose the landing place of a vehicle at a time (s); return its distance, m.

        Parameters
        ----------
        positions : (n, 3) array
            Of all vehicles, m; NaN where they are not known.
        is_landing : (n,) array of bool
            Which of them descend, or are on the ground.
        """
        start, places = positions[number].copy(), positions.copy()
        for other, descent in self._descents.items():
            if self.is_under_way(other, time):
                places[other, :2] = descent.place
        known = np.asarray(np.isfinite(places).all(axis=1))
        place = start[:2]
        if known[number]:
            index, limits = int(known[:number].sum()), self._limits[np.ix_(known, known)]
            place = np.array(free_place(index, places[known], is_landing[known], limits))
        distance = float(np.nan_to_num(np.linalg.norm(place - start[:2])))
        duration = _MARGIN * shortest_duration(distance)
        self._descents[number] = _Descent(start, place, duration, time, time)
        return distance

    def reference(self, number: int, time: float, z: float, z_dot: float) -> list[float] | None:
        """Return x, y, z (m), x_dot, y_dot, z_dot (m/s); None if the vehicle lands where it is.

        The descent straight down, z (m) and z_dot (m/s) at a time (s), takes effect as far as the
        move sideways is done: at first the vehicle keeps its height.
        """
        descent = self._descents[number]
        descent.last = time
        if descent.duration == 0.0:
            return None
        s = min((time - descent.begin) / descent.duration, 1.0)
        done, slope = minimum_jerk(s)
        path = np.array([*descent.place, z]) - descent.start
        velocity = slope / descent.duration * path + done * np.array([0.0, 0.0, z_dot])
        return [*(descent.start + done * path).tolist(), *velocity.tolist()]
