"""Trajectories of polynomials: demands on a vehicle, positions over time, and checks."""

import math
from collections.abc import Collection, Mapping

import numpy as np

from crazyflie_mission_api.limits import Array, Bounds, Clearance, Limits, MissionError
from crazyflie_model.angles import Triple
from crazyflie_model.planner import smooth_piece
from crazyflie_model.polynomials import Goal, PolynomialPiece, at_rest, evaluate
from crazyflie_model.trajectory import Pieces, Trajectory, duration, stretched
from crazyflie_model.units import GRAVITY

SAMPLES = 30  #: Number of points of a piece that are evaluated.

_UNITS = {
    "speed": "m/s",
    "acceleration": "m/s^2",
    "yaw_rate": "rad/s",
    "tilt": "rad",
    "max_thrust": "m/s^2",
    "min_thrust": "m/s^2",
}
_TOLERANCE = 1e-6

#: Shortest duration of a trajectory (s): a trajectory without motion has no demands.
_SHORTEST = 1e-3

_STEP = 0.05  #: Time between two checks of distances (s).

START_SKEW = 0.15
"""Largest difference between the starts of vehicles behind the driver, s.

Each is called by itself, unless all of a driver are started. At most 0.04 s was measured for ten
vehicles and 0.11 s for twenty, by UDP on a busy machine with two cores. A Crazyradio, which serves
its vehicles one after the other, has not been measured.
"""


def sampled(pieces: Pieces) -> tuple[Array, Array]:
    """Return n times (s), shape (n,), and the trajectory at them, shape (3, 4, n).

    Axes: derivative (value, first, second); x, y, z (m), yaw (rad); `SAMPLES` points of each piece.
    """
    begins = np.cumsum([0.0, *(piece.duration for piece in pieces)])
    times: list[Array] = [
        np.linspace(0.0, piece.duration, SAMPLES, dtype=np.float64) for piece in pieces
    ]

    def values(piece, time):
        return np.stack([np.stack(evaluate(axis, time)) for axis in piece.axes], axis=1)

    columns = [values(piece, time) for piece, time in zip(pieces, times, strict=True)]
    times = [begin + time for begin, time in zip(begins, times, strict=False)]
    return np.concatenate(times), np.concatenate(columns, axis=-1)


def demands(values: Array) -> dict[str, Array]:
    """Return the demands on the vehicle, shape (n,), by the name of the limit.

    The values are as from `sampled`. Thrust points along acceleration minus gravity (Mellinger and
    Kumar, Minimum Snap Trajectory Generation and Control for Quadrotors, ICRA 2011).
    """
    _, velocity, acceleration = values
    thrust = acceleration[:3] + [[0.0], [0.0], [GRAVITY]]
    return {
        "speed": np.linalg.norm(velocity[:3], axis=0),
        "acceleration": np.linalg.norm(acceleration[:3], axis=0),
        "yaw_rate": np.abs(velocity[3]),
        "tilt": np.arctan2(np.hypot(thrust[0], thrust[1]), thrust[2]),
        "max_thrust": np.linalg.norm(thrust, axis=0),
        "min_thrust": -np.linalg.norm(thrust, axis=0),
    }


def excess(pieces: Pieces, limits: Limits) -> dict[str, tuple[float, float]]:
    """Return which limits a trajectory exceeds: name to the worst value and its moment (s)."""
    times, values = sampled(pieces)
    found = {}
    for name, demand in demands(values).items():
        worst = int(demand.argmax())
        limit = getattr(limits, name) * (-1.0 if name == "min_thrust" else 1.0)
        if demand[worst] > limit + _TOLERANCE:
            found[name] = (abs(float(demand[worst])), float(times[worst]))
    return found


def check_numbers(pieces: Pieces, what: str) -> None:
    """Refuse a trajectory without pieces, or with numbers that are not finite: `MissionError`."""
    try:
        valid = all(isinstance(piece, PolynomialPiece) for piece in pieces)
    except TypeError:
        valid = False
    if not valid:
        raise MissionError(f"{what} is {pieces!r}; expected a list of PolynomialPiece")
    if not pieces:
        raise MissionError(f"{what} has no pieces")
    for number, piece in enumerate(pieces, start=1):
        numbers = [piece.duration, *(c for axis in piece.axes for c in axis)]
        if not all(map(math.isfinite, numbers)) or piece.duration <= 0.0:
            raise MissionError(
                f"{what}: piece {number} has numbers that are not finite, or a duration of "
                f"{piece.duration:g} s; expected finite numbers, and more than 0 s"
            )


def check(pieces: Pieces, limits: Limits, bounds: Bounds, what: str, slower: str) -> None:
    """Refuse a trajectory that demands too much, or leaves the bounds.

    `MissionError` names ``what`` it is, and a remedy that makes it ``slower``.
    """
    bounds.check(sampled(pieces)[1][0, :3].T, what)
    for name, (value, time) in excess(pieces, limits).items():
        words = name.replace("max_", "").replace("min_", "").replace("_", " ")
        side = "least" if name == "min_thrust" else "most"
        raise MissionError(
            f"{what}: the {words} is {value:.3g} {_UNITS[name]} at {time:.2f} s; expected at "
            f"{side} {getattr(limits, name):g} {_UNITS[name]}; {slower} makes it slower"
        )


def straight(
    start: Triple, goal: Triple, start_yaw: float = 0.0, yaw: float = 0.0, seconds: float = 1.0
) -> list[PolynomialPiece]:
    """Return the straight move from rest to rest, m; the turn, rad, is the shorter one."""
    return [smooth_piece(at_rest(start, start_yaw), goal, yaw, seconds)]


def within_limits(pieces: Pieces, limits: Limits) -> list[PolynomialPiece]:
    """Return the trajectory on the same path, as slow as the limits demand.

    If the time is s times as long, speeds and yaw rates are 1/s, accelerations 1/s^2 as large. Tilt
    and thrust also depend on gravity, which does not scale; for these the time is stretched in
    steps until the limits are kept.
    """
    peaks = {name: float(values.max()) for name, values in demands(sampled(pieces)[1]).items()}
    factor = max(
        peaks["speed"] / limits.speed,
        peaks["yaw_rate"] / limits.yaw_rate,
        math.sqrt(peaks["acceleration"] / limits.acceleration),
        _SHORTEST / duration(pieces),
    )
    slow = stretched(pieces, factor)
    while excess(slow, limits):
        slow = stretched(slow, 1.05)
    return slow


class TimedTrajectory:
    """A trajectory from ``begin`` (s) on, then rest at its end.

    ``start_skew`` is the largest delay of the vehicle's start, s.
    """

    def __init__(self, plan: Pieces | Trajectory, begin: float, start_skew: float = 0.0):
        self._trajectory = plan if isinstance(plan, Trajectory) else Trajectory(plan)
        self.begin = begin
        self.start_skew = start_skew

    @classmethod
    def hover(cls, position: Triple, yaw: float = 0.0) -> "TimedTrajectory":
        """Return the trajectory of a vehicle that stays."""
        return cls(straight(position, position, yaw, yaw), -math.inf)

    @property
    def end(self) -> float:
        """Planned end, s."""
        return self.begin + self._trajectory.duration

    def goal(self, time: float) -> Goal[float]:
        """Return the goal at a time (s)."""
        return self._trajectory.evaluate(time - self.begin)

    @property
    def destination(self) -> Goal[float]:
        """The goal at the end, at rest."""
        return self._trajectory.evaluate(math.inf)

    def later(self, delay: float) -> "TimedTrajectory":
        """Return the trajectory with a delay, s."""
        return TimedTrajectory(self._trajectory, self.begin + delay, self.start_skew)

    def positions(self, times: Array) -> Array:
        """Return the positions at n times (s), shape (n, 3), m."""
        if self.end <= times[0]:
            return np.tile(self.destination.position, (len(times), 1))
        return np.stack(self._trajectory.evaluate(times - self.begin).position, axis=-1)


def check_apart(
    trajectories: Mapping[str, TimedTrajectory],
    now: float,
    clearance: Clearance,
    resting: Collection[str] = (),
    may_be_late: bool = False,
) -> None:
    """Refuse trajectories on which two vehicles come too near, unless both are ``resting``.

    They are also checked with a late start of each vehicle, if starts ``may_be_late``.
    `MissionError` names the vehicles.
    """
    if len(trajectories) < 2:
        return
    end = max(now, *(each.end for each in trajectories.values()))
    times = np.linspace(now, end, math.ceil((end - now) / _STEP) + 1, dtype=np.float64)
    places = np.stack([each.positions(times) for each in trajectories.values()])
    clearance.check([*trajectories], times - now, places, resting)
    moving = [name for name, each in trajectories.items() if each.end > now]
    skew = max((trajectories[name].start_skew for name in moving), default=0.0)
    if not may_be_late or skew == 0.0 or len(moving) < 2:
        return
    for name in moving:
        late = {**trajectories, name: trajectories[name].later(skew)}
        try:
            check_apart(late, now, clearance, resting)
        except MissionError as error:
            raise MissionError(
                f"{error}; this happens if {name} begins {skew:g} s after the others"
            ) from None
