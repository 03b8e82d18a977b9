"""Descents that lead beside the vehicles beneath, and not onto them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crazyflie_fleet.landing import free_place
from crazyflie_fleet.straight_move import StraightMove, evaluate, shortest_duration

_MARGIN = 1.1
"""Duration of the move sideways, in the shortest possible ones."""

_MAX_GAP = 0.5
"""Between two references of one descent, s."""


@dataclass
class _Descent:
    """A move sideways, at the height of its start; times are in s."""

    move: StraightMove
    begin: float
    last: float


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
        """Choose the landing place of a vehicle; return its distance, m.

        Parameters
        ----------
        number : int
        time : float
            s.
        positions : (n, 3) array
            Of all vehicles, m; NaN where they are not known.
        is_landing : (n,) array of bool
            Which of them descend, or are on the ground.
        """
        places = positions.copy()
        for other, descent in self._descents.items():
            if self.is_under_way(other, time):
                places[other, :2] = descent.move.goal[:2]
        known = np.asarray(np.isfinite(places).all(axis=1))
        start = goal = np.nan_to_num(positions[number])
        if known[number]:
            index = int(known[:number].sum())
            limits = self._limits[np.ix_(known, known)]
            goal = np.array(
                [*free_place(index, places[known], is_landing[known], limits), start[2]]
            )
        duration = _MARGIN * shortest_duration(float(np.linalg.norm(goal - start)))
        move = StraightMove(start, goal, max(duration, 1e-3))
        self._descents[number] = _Descent(move, time, time)
        return move.distance

    def reference(self, number: int, time: float, z: float, z_dot: float) -> list[float] | None:
        """Return x, y, z (m), x_dot, y_dot, z_dot (m/s); None if the vehicle lands where it is.

        Parameters
        ----------
        number : int
        time : float
            s.
        z, z_dot : float
            Of the descent straight down, m and m/s. It takes effect as far as the move sideways
            is done: at first the vehicle keeps its height.
        """
        descent = self._descents[number]
        descent.last = time
        move = descent.move
        if move.distance == 0.0:
            return None
        (position,), (velocity,) = evaluate([move], [time - descent.begin])
        done = float(np.linalg.norm(position - move.start)) / move.distance
        rate = float(np.linalg.norm(velocity)) / move.distance
        height = float(move.start[2])
        return [
            *position[:2].tolist(),
            height + done * (z - height),
            *velocity[:2].tolist(),
            done * z_dot + rate * (z - height),
        ]
