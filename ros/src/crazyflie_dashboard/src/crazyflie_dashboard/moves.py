"""Go-to commands: the goals of a formation, and a check of the distances between vehicles."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from crazyflie_dashboard.snapshot import Rotation, Triple
from crazyflie_fleet.fleet_config import DOWNWASH, close_pairs
from crazyflie_fleet.separation import RELEASE_RATIO
from crazyflie_model.angles import rotate_back, rpy_from_quaternion
from crazyflie_model.trajectory import minimum_jerk
from crazyflie_utils.refusal import RefusalError, distinct

SEPARATION = 0.3  #: Distance between two vehicles, as that of missions by default (m).
#: Distance from its planned move beyond which a vehicle has received another command (m).
FAR = 0.5

_STEP = 0.05  #: Distance between two checked places of the fastest vehicle (m).
_MAX_STEPS = 400
#: Distance by which two vehicles that are too near already may still approach (m).
_APPROACH = 0.02


@dataclass(frozen=True)
class Move:
    """A straight move from rest to rest: start and goal in m, begin and duration in s."""

    start: Triple
    goal: Triple
    begin: float = 0.0
    duration: float = 1.0


def formation(places: Mapping[str, Triple], goal: Triple) -> dict[str, Triple]:
    """Return the goals of vehicles, m, so that their centre comes to the goal."""
    x, y, z = (goal[k] - sum(p[k] for p in places.values()) / len(places) for k in range(3))
    return {name: (p[0] + x, p[1] + y, p[2] + z) for name, p in places.items()}


def in_frame(point: Triple, yaw: float, frame: tuple[Triple, Rotation]) -> tuple[Triple, float]:
    """Return a point (m) and a heading (rad) in a frame, whose own position and rotation are known.

    `ValueError`: the rotation is not a quaternion.
    """
    (a, b, c), rotation = frame
    x, y, z = rotate_back(rotation, (point[0] - a, point[1] - b, point[2] - c))
    return (x, y, z), yaw - rpy_from_quaternion(*rotation)[2]


def expect_apart(
    moves: Mapping[str, Move],
    places: Mapping[str, Triple],
    known: Mapping[str, Move],
    buffers: Mapping[str, float],
    now: float,
) -> None:
    """Refuse moves on which two vehicles come nearer than missions allow.

    Parameters
    ----------
    moves : dict
        Moves that are to begin ``now``, s, by vehicle.
    places : dict
        Positions of all vehicles, m; those that do not move stay there.
    known : dict
        Moves that began before; each is considered while its vehicle follows it.
    buffers : dict
        Collision buffers of vehicles that have one, m.

    `RefusalError`: the text names the first two.
    """
    names = list(places)
    radii = [max(SEPARATION / 2.0, RELEASE_RATIO * buffers.get(name, 0.0)) for name in names]
    present = {name: Move(place, place) for name, place in places.items()}
    for name, move in known.items():
        is_on_its_way = name in places and now < move.begin + move.duration
        if is_on_its_way and math.dist(_places([move], now)[0], places[name]) < FAR:
            present[name] = move
    rows = [moves.get(name, present[name]) for name in names]
    end = max(move.begin + move.duration for move in rows)
    way = max(math.dist(move.start, move.goal) for move in rows)
    before = np.array(list(places.values()))
    for time in np.linspace(now, max(end, now), min(2 + math.ceil(2.0 * way / _STEP), _MAX_STEPS)):
        for i, j, distance, limit in close_pairs(_places(rows, time), radii):
            one, two = names[i], names[j]
            apart = np.linalg.norm((before[i] - before[j]) / (1.0, 1.0, DOWNWASH))
            if moves.keys() & {one, two} and distance < apart - _APPROACH:
                shown, least = distinct(distance, limit)
                raise RefusalError(
                    f"go to: {one} and {two} would be {shown} m apart, {time - now:.1f} s from "
                    f"now; expected at least {least} m, with vertical distances halved"
                )


def _places(moves, time):
    """Return the positions of moves at a time, s, shape (n, 3), m."""
    begins, durations = (np.array([getattr(m, a) for m in moves]) for a in ("begin", "duration"))
    value, _ = minimum_jerk(np.clip((time - begins) / durations, 0.0, 1.0)[:, None])
    start = np.array([move.start for move in moves])
    return start + (np.array([move.goal for move in moves]) - start) * value
