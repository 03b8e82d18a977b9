"""Reflecting markers: their motion, its prediction, and their assignment to points of a frame."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from crazyflie_model.angles import Triple

Point = npt.NDArray[np.float64]  #: x, y, z in m, z up.
GATE = 4.0  #: Gate in standard deviations: for three normal variables, 1 in 1000 is farther away.

#: Variance along each axis (m^2). OptiTrack states less than 0.3 mm; markers that some cameras see
#: only in part have larger errors.
_MEASUREMENT_VARIANCE = 0.002**2

#: Cost in the units of `Marker.costs`:
#: -2 log(0.1 * 0.1 / m^3 * (2 pi _MEASUREMENT_VARIANCE)^1.5), for a marker that is missing in one
#: frame of ten, and one reflection in 10 m^3.
UNSEEN_COST = 40.0

_FIRST_SPEED_VARIANCE = 1.0  #: Variance of the velocity after the first measurement (m^2/s^2).
_BOX_MARGIN = GATE * (2.0 * _MEASUREMENT_VARIANCE) ** 0.5  #: Noise of two measurements, m.

#: Time (s) for which a resting marker stays in a region, and size of that (m).
_REST_TIME, REST_RADIUS = 0.5, 0.02

#: Number of frames in which a marker must be seen before it is assigned to a vehicle: reflections
#: flash.
_LEAST_SIGHTINGS = 3


class MotionLimits(NamedTuple):
    """Limits of a vehicle's motion."""

    #: Largest velocity along each axis (m/s), as in crazyswarm2's dynamics configurations.
    max_velocity: Triple = (2.0, 2.0, 3.0)
    #: Largest acceleration (m/s^2): three standard deviations of the filter's.
    max_acceleration: float = 8.0


class Marker:
    """A marker that is followed from frame to frame.

    Its position is a constant-velocity Kalman filter's, whose three axes have one covariance. The
    acceleration is constant from one measurement to the next, and independent of that before
    (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
    section 6.3.2, discrete white noise acceleration). The first measurement was made at ``time``
    (s), of a ``position`` (3,) in m.
    """

    def __init__(self, time: float, position: Point, limits: MotionLimits):
        #: first_seen, time: Times of the first and the last measurement (s).
        self.first_seen = self.time = self._rests_since = time
        self.measured = self._rest = position  #: The last measurement, m.
        self.position, self.velocity = position, np.zeros(3)  #: Estimates at that time, m and m/s.
        self.limits = limits  #: Limits, used from the next prediction on.
        self._covariance = (_MEASUREMENT_VARIANCE, 0.0, _FIRST_SPEED_VARIANCE)
        self._sightings = 1

    @property
    def flashes(self) -> bool:
        """Whether it has been seen in too few frames to belong to a vehicle."""
        return self._sightings < _LEAST_SIGHTINGS

    @property
    def rests(self) -> bool:
        """Whether it has been at one place for a while."""
        return self.time - self._rests_since >= _REST_TIME

    def variance(self, time: float) -> float:
        """Return the variance of the next measurement along each axis, m^2."""
        return self._predicted(time - self.time)[0] + _MEASUREMENT_VARIANCE

    def radius(self, time: float) -> float:
        """Return the largest distance of the marker from its predicted position, m."""
        return GATE * float(self.variance(time) ** 0.5)

    def costs(self, time: float, points: Point) -> npt.NDArray[np.float64]:
        """Return the costs of measurements (n, 3): -2 times the logarithm of their density.

        They are relative to a measurement without error, and infinite beyond `GATE` and where the
        marker would exceed its maximum velocity.
        """
        dt, variance = time - self.time, self.variance(time)
        squares = np.sum((points - self.position - dt * self.velocity) ** 2, axis=1) / variance
        is_possible = self.can_reach(points, dt) & (squares <= GATE**2)
        spread = 3.0 * math.log(variance / _MEASUREMENT_VARIANCE)
        return np.where(is_possible, squares + spread, np.inf)

    def can_reach(self, points: Point, dt: float) -> npt.NDArray[np.bool_]:
        """Return whether points (n, 3) can be reached in a time (s) by the maximum velocity."""
        reach = np.array(self.limits.max_velocity) * dt + _BOX_MARGIN
        return np.all(abs(points - self.measured) <= reach, axis=-1)

    def update(self, time: float, measured: Point) -> None:
        """Process a measurement (m)."""
        dt = time - self.time
        p, m, v = self._predicted(dt)
        gain_p, gain_v = np.array((p, m)) / (p + _MEASUREMENT_VARIANCE)
        predicted = self.position + dt * self.velocity
        self.position = predicted + gain_p * (measured - predicted)
        self.velocity = self.velocity + gain_v * (measured - predicted)
        self._covariance = ((1.0 - gain_p) * p, (1.0 - gain_p) * m, v - gain_v * m)
        self.time, self.measured = time, measured
        self._sightings += 1
        if math.dist(measured, self._rest) > REST_RADIUS:
            self._rest, self._rests_since = measured, time

    def _predicted(self, dt: float) -> tuple[float, float, float]:
        p, m, v = self._covariance
        q = (self.limits.max_acceleration / 3.0) ** 2
        return (
            p + 2.0 * dt * m + dt * dt * v + q * dt**4 / 4.0,
            m + dt * v + q * dt**3 / 2.0,
            v + q * dt * dt,
        )


#: Least difference of cost to the second-best assignment, which is less likely by exp(-3), or 1 in
#: 20.
_AMBIGUITY = 6.0

_IMPOSSIBLE = 1e6


def assign(
    markers: Sequence[Marker], time: float, points: Point
) -> tuple[dict[int, int], set[int]]:
    """Return index of marker -> index of point, and the markers that may be another point, too.

    The assignment is the most likely one: it has the least sum of `Marker.costs`, and of
    `UNSEEN_COST` for each marker that is not seen. A pair is ambiguous when the marker has another
    point within its gate, or the point another marker, and the best assignment without the pair
    costs little more. ``time`` is the frame's, s; ``points`` are of shape (n, 3), m.
    """
    m, n = len(markers), len(points)
    costs = np.full((m, n + m), _IMPOSSIBLE)
    for row, marker in enumerate(markers):
        costs[row, :n] = np.minimum(marker.costs(time, points), _IMPOSSIBLE)
        costs[row, n + row] = UNSEEN_COST
    rows, columns = linear_sum_assignment(costs)
    best = costs[rows, columns].sum()
    pairs = {int(r): int(c) for r, c in zip(rows, columns, strict=True) if c < n}
    possible = costs[:, :n] < _IMPOSSIBLE
    rivals = possible.sum(axis=0)
    ambiguous = {
        row
        for row, column in pairs.items()
        if possible[row].sum() + rivals[column] > 2
        and _best_without(costs, row, column) - best < _AMBIGUITY
    }
    return pairs, ambiguous


def _best_without(costs, row, column):
    others = costs.copy()
    others[row, column] = _IMPOSSIBLE
    return others[linear_sum_assignment(others)].sum()
