"""How well single markers are tracked here, and by librigidbodytracker's rule, on the same frames.

python3 ros/src/mocap_optitrack/bench/single_markers.py
"""

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from mocap_optitrack.marker_tracker import MarkerTracker
from mocap_optitrack.marker_vehicle import MarkerVehicle

sys.path.insert(0, str(Path(__file__).parents[1] / "test"))
from swarm_scenes import Cameras, Score, SwapFlight, fly

VEHICLES, FLIGHTS = 20, 5


class NearestMarkers:
    """The rule of librigidbodytracker for single markers (rigid_body_tracker.cpp, updatePosition).

    Without its limit to the 5 nearest markers.
    """

    MAX_VELOCITY = np.array((2.0, 2.0, 3.0))
    MAX_LOSS, MAX_GAP = 0.5, 0.4

    def __init__(self, starts: Any) -> None:
        self._starts = starts
        self._places, self._times = starts.copy(), np.full(len(starts), -math.inf)
        self._last_frame = -math.inf
        self._is_initialized = False

    def update(self, time: float, points: Any) -> dict[str, Any]:
        """Return name -> position."""
        if not len(points):
            return {}
        is_first = not self._is_initialized or time - self._last_frame > self.MAX_GAP
        self._last_frame = time
        places = self._starts if is_first else self._places
        offsets = points[np.newaxis] - places[:, np.newaxis]
        costs = np.linalg.norm(offsets, axis=2)
        if not is_first:
            dt = (time - self._times)[:, np.newaxis, np.newaxis]
            reachable = np.all(abs(offsets) < self.MAX_VELOCITY * dt, axis=2)
            costs[~(reachable & (dt[:, :, 0] <= self.MAX_LOSS))] = 1e6
        found = {}
        for row, column in zip(*linear_sum_assignment(costs), strict=True):
            if costs[row, column] < 1e6:
                self._places[row], self._times[row] = points[column], time
                found[str(row)] = tuple(points[column])
        if is_first:
            self._is_initialized = len(found) == len(places)
        return found


def main() -> None:
    """Print a table."""
    rows = {
        "a clear view": {},
        "a marker in ten missing": {"dropout": 0.1},
        "2 reflections in a frame": {"flashes": 2.0},
        "each hidden twice, up to 0.3 s": {"hidden": (2, 0.3)},
        "the same, and 1 reflection in a frame": {"hidden": (2, 0.3), "flashes": 1.0},
        "each hidden three times, up to 0.8 s": {"hidden": (3, 0.8)},
    }
    print("| | librigidbodytracker's rule, % | here, % |\n|---|---|---|")
    for label, options in rows.items():
        scores = [_mean(options, rule) for rule in (_nearest, _tracker)]
        print(f"| {label} | {scores[0]} | {scores[1]} |")


def _mean(options, rule):
    total = Score()
    for seed in range(FLIGHTS):
        flight = SwapFlight(VEHICLES)
        times, longest = options.get("hidden", (0, 0.0))
        random = np.random.default_rng(seed)
        hidden = [
            (k, random.uniform(1.2, flight.end), random.uniform(0.0, longest))
            for k in range(VEHICLES)
            for _ in range(times)
        ]
        others = {key: value for key, value in options.items() if key != "hidden"}
        score = fly(flight, Cameras(seed, occlusions=hidden, **others), rule(flight.starts))
        for name, value in vars(score).items():
            setattr(total, name, getattr(total, name) + value)
    return ", ".join(
        f"{100.0 * count / total.frames:.1f}"
        for count in (total.tracked, total.swaps, total.ghosts)
    )


def _nearest(starts):
    return NearestMarkers(starts).update


def _tracker(starts):
    vehicles = [MarkerVehicle(str(k), tuple(start)) for k, start in enumerate(starts)]
    return MarkerTracker(vehicles).update


if __name__ == "__main__":
    main()
