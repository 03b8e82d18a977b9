"""Limits of missions: demands on a vehicle, the box that it may fly in, and distances."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import pdist

from crazyflie_fleet.separation import LOOK_AHEAD, RELEASE_RATIO, SCALE, Separation
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_model.units import GRAVITY
from crazyflie_utils.parameters.types import Number
from crazyflie_utils.refusal import distinct

Array = NDArray[np.float64]


class MissionError(Exception):
    """A mission cannot be flown; the text names the cause, its value and the expected one."""


@dataclass(frozen=True)
class Limits:
    """Largest demands of a trajectory on a vehicle."""

    #: speed, acceleration: Largest speed and acceleration (m/s, m/s^2).
    speed: float = 0.5
    acceleration: float = 1.0
    #: Largest yaw rate (rad/s). Largest angle between thrust and vertical (rad), the limit of the
    #: controllers.
    yaw_rate: float = 1.5
    tilt: float = MAX_TILT
    #: min_thrust, max_thrust: Range of the thrust (m/s^2), that of the controllers.
    min_thrust: float = MIN_THRUST
    max_thrust: float = MAX_THRUST

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, value in vars(self).items():
            number(value, f"limits: {name}", above=0.0)
        if not self.min_thrust < GRAVITY < self.max_thrust:
            raise MissionError(
                f"limits: min_thrust is {self.min_thrust:g}, and max_thrust {self.max_thrust:g}; "
                f"expected one below and one above {GRAVITY:g} m/s^2, which hovers"
            )


@dataclass(frozen=True)
class Bounds:
    """The box that vehicles may fly in."""

    #: lower, upper: Corners, in the frame of the vehicles' states (m).
    lower: tuple[float, float, float]
    upper: tuple[float, float, float]

    def __post_init__(self) -> None:
        """Check the corners."""
        try:
            corners = np.array([self.lower, self.upper], dtype=float)
        except (TypeError, ValueError):
            corners = np.empty(0)
        if corners.shape != (2, 3) or not (corners[0] < corners[1]).all():
            raise MissionError(
                f"bounds are {self.lower!r} to {self.upper!r} m; expected a lower and an upper "
                "corner x, y, z"
            )

    def within(self, other: "Bounds") -> "Bounds":
        """Return the intersection of both boxes."""
        lower = np.maximum(self.lower, other.lower).tolist()
        return Bounds(tuple(lower), tuple(np.minimum(self.upper, other.upper).tolist()))

    def check(self, positions: Array, what: str) -> None:
        """Refuse positions outside by a `MissionError`, in which they are ``what``.

        The positions have the shape (3,) or (n, 3), m.
        """
        for axis, name in enumerate("xyz"):
            values = np.atleast_2d(positions)[:, axis]
            for value in (values.min(), values.max()):
                if not self.lower[axis] - 1e-6 <= value <= self.upper[axis] + 1e-6:
                    raise MissionError(
                        f"{what} is out of bounds: {name} is {value:.3g} m; expected "
                        f"{self.lower[axis]:g} to {self.upper[axis]:g} m"
                    )


#: All positions above the ground.
EVERYWHERE = Bounds((-math.inf, -math.inf, 0.0), (math.inf, math.inf, math.inf))


def point(value: Sequence[float], what: str) -> Array:
    """Return a point of a user as an array, shape (3,), m.

    `MissionError`: the value is not three finite numbers.
    """
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise MissionError(f"{what} is {value!r}; expected x, y, z in m, finite numbers")
    return array


def number(
    value: float,
    what: str,
    minimum: float = -math.inf,
    above: float = -math.inf,
    maximum: float = math.inf,
) -> float:
    """Return a finite number, minimum to maximum and more than ``above``; or `MissionError`."""
    kind = Number(above=above, minimum=minimum, maximum=maximum)
    try:
        # A text may be a number in a file, and not here.
        if isinstance(value, str):
            raise ValueError
        return kind(value.item() if isinstance(value, np.generic) else value)
    except ValueError:
        raise MissionError(f"{what} is {value!r}; expected {kind}") from None


@dataclass(frozen=True)
class Clearance:
    """Distances between the vehicles of a mission, m.

    A fleet process holds a vehicle that comes nearer to another than both their ``buffers``, and
    releases it when it is `crazyflie_fleet.separation.RELEASE_RATIO` times as far away: a mission
    keeps that distance.
    """

    separation: float = 0.3  # Distance of any two; `DOWNWASH` times as much vertically (m).
    buffers: Mapping[str, float] = field(default_factory=dict)

    def limits(self, names: Sequence[str]) -> Array:
        """Return the distance that each two of n vehicles must keep, shape (n, n), m."""
        radii = np.array([self.buffers.get(name, -np.inf) for name in names])
        return np.maximum(self.separation, RELEASE_RATIO * (radii[:, None] + radii))

    def check(
        self, names: Sequence[str], times: Array, places: Array, resting: Collection[str] = ()
    ) -> None:
        """Refuse positions that are too near, or approached so fast that the fleet holds vehicles.

        ``places``, shape (n, m, 3), are the positions (m) of n vehicles, two at least, at ``times``
        from now (s), shape (m,). Two that are ``resting``, on the ground with their motors off, may
        be at any distance. `MissionError` names two vehicles, and the time.
        """
        first, second = np.triu_indices(len(names), 1)
        rests = np.array([name in resting for name in names])
        limits = np.where(rests[first] & rests[second], 0.0, self.limits(names)[first, second])
        for k, time in enumerate(times):
            distances = pdist(places[:, k] * SCALE)
            worst = int((distances - limits).argmin())
            if distances[worst] < limits[worst] - 1e-9:
                one, two = names[first[worst]], names[second[worst]]
                shown, least = distinct(distances[worst], limits[worst], "g", 3)
                raise MissionError(
                    f"{one} and {two} would be {shown} m apart, {time:.1f} s from now; expected at "
                    f"least {least} m{self._reasons(one, two)}"
                )
        self._check_speeds(names, times, places)

    def _check_speeds(self, names, times, places):
        """Refuse motions at which the fleet, which extrapolates positions, would hold vehicles."""
        watched = [k for k, name in enumerate(names) if name in self.buffers]
        if len(watched) < 2 or len(times) < 3:
            return
        separation = Separation([RELEASE_RATIO * self.buffers[names[k]] for k in watched])
        seen = places[watched]
        velocities = np.gradient(seen, times, axis=1)
        for k, time in enumerate(times[:-1]):
            # A reference is a little ahead of the vehicle that follows it.
            held, pairs = separation.update(seen[:, k], velocities[:, k], seen[:, k + 1])
            for pair in pairs:
                if held[pair.first] or held[pair.second]:
                    one, two = names[watched[pair.first]], names[watched[pair.second]]
                    raise MissionError(
                        f"{one} and {two} would come near each other too fast, {time:.1f} s from "
                        f"now: at {pair.distance:.3g} m, and in {LOOK_AHEAD:g} s at their speeds "
                        f"less than {pair.limit:.3g} m; expected slower or other paths"
                        f"{self._reasons(one, two)}"
                    )

    def _reasons(self, one, two):
        if one not in self.buffers or two not in self.buffers:
            return ""
        return (
            f" (the mission's separation is {self.separation:g} m; the collision buffers, with "
            f"which the fleet holds vehicles apart, are {self.buffers[one]:g} and "
            f"{self.buffers[two]:g} m, and {RELEASE_RATIO:g} times as much lets them go on)"
        )
