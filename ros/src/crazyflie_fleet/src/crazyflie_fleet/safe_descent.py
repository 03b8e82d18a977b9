"""Descents that lead beside the vehicles beneath, and not onto them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from crazyflie_fleet.landing import free_place
from crazyflie_fleet.way import Way, along, shortest

_MARGIN = 1.1
"""Durations of straight ways sideways, in the shortest possible ones."""


class SafeDescents:
    """Landing places of vehicles that descend.

    A vehicle with another beneath it flies to the nearest free place while it sinks.

    Parameters
    ----------
    buffers : sequence of float
        Collision buffer of each vehicle, m.
    """

    def __init__(self, buffers: Sequence[float]):
        radii = np.array(buffers, dtype=float)
        self._limits = radii[:, None] + radii
        self._ways: dict[int, Way] = {}
        self._begins: dict[int, float] = {}

    def begin(
        self,
        number: int,
        time: float,
        positions: NDArray[np.float64],
        is_landing: NDArray[np.bool_],
    ) -> float:
        """Choose where a vehicle lands; return how far that is from where it is, m.

        Parameters
        ----------
        number : int
        time : float
            s.
        positions : (n, 3) array
            Of all vehicles, m; NaN where it is not known.
        is_landing : (n,) array of bool
            Which of them descend, or are on the ground.
        """
        places = positions.copy()
        for other, way in self._ways.items():
            places[other, :2] = way.goal[:2]
        known = np.flatnonzero(np.isfinite(places).all(axis=1))
        start = goal = positions[number]
        if number in known:
            x, y = free_place(
                int(np.flatnonzero(known == number)[0]),
                places[known],
                is_landing[known],
                self._limits[np.ix_(known, known)],
            )
            goal = np.array((x, y, start[2]))
        distance = float(np.linalg.norm(goal - start))
        self._ways[number] = Way(start, goal, max(_MARGIN * shortest(distance), 1e-3))
        self._begins[number] = time
        return distance

    def end(self, number: int) -> None:
        """Forget where a vehicle lands."""
        self._ways.pop(number, None)

    def __contains__(self, number: int) -> bool:
        """Return whether a landing place was chosen for a vehicle."""
        return number in self._ways

    def reference(self, number: int, time: float, z: float, z_dot: float) -> list[float] | None:
        """Return x, y, z (m), x_dot, y_dot, z_dot (m/s); None if a vehicle lands where it is.

        Parameters
        ----------
        number : int
        time : float
            s.
        z, z_dot : float
            Of the descent straight down, m and m/s. It takes effect as far as the way sideways is
            done: at the beginning the vehicle keeps its height.
        """
        way = self._ways[number]
        distance = float(np.linalg.norm(way.goal - way.start))
        if distance == 0.0:
            return None
        (position,), (velocity,) = along([way], [time - self._begins[number]])
        done = float(np.linalg.norm(position - way.start)) / distance
        rate = float(np.linalg.norm(velocity)) / distance
        height = float(way.start[2])
        return [
            *position[:2].tolist(),
            height + done * (z - height),
            *velocity[:2].tolist(),
            done * z_dot + rate * (z - height),
        ]
