"""Distances between vehicles: of the mission, and of the fleet that keeps them apart."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.distance import pdist

from crazyflie_fleet.separation import LOOK_AHEAD, RELEASE_RATIO, Separation
from crazyflie_mission_api.formations import SCALE
from crazyflie_mission_api.limits import Array, MissionError


@dataclass(frozen=True)
class Clearance:
    """Distances that the vehicles of a mission keep, m.

    A fleet process holds a vehicle that comes nearer to another than both their ``buffers``, and
    releases it when it is `crazyflie_fleet.separation.RELEASE_RATIO` times as far away: a mission
    keeps that distance.
    """

    separation: float = 0.3  # Of any two; `DOWNWASH` times as much one above the other.
    buffers: Mapping[str, float] = field(default_factory=dict)

    def limits(self, names: Sequence[str]) -> Array:
        """Return how far apart each two of n vehicles have to be, shape (n, n), m."""
        radii = np.array([self.buffers.get(name, -np.inf) for name in names])
        return np.maximum(self.separation, RELEASE_RATIO * (radii[:, None] + radii))

    def check(
        self, names: Sequence[str], times: Array, places: Array, resting: Collection[str] = ()
    ) -> None:
        """Refuse positions that are too near, or approached so fast that the fleet holds vehicles.

        Parameters
        ----------
        names : sequence of str
            Of n vehicles, two at least.
        times : ndarray, shape (m,)
            From now, s.
        places : ndarray, shape (n, m, 3)
            Where each is then, m.
        resting : collection of str
            Those on the ground with their motors off: two of them may be at any distance.

        Raises
        ------
        MissionError
        """
        first, second = np.triu_indices(len(names), 1)
        rests = np.array([name in resting for name in names])
        limits = np.where(rests[first] & rests[second], 0.0, self.limits(names)[first, second])
        for k, time in enumerate(times):
            distances = pdist(places[:, k] * SCALE)
            worst = int((distances - limits).argmin())
            if distances[worst] < limits[worst] - 1e-9:
                one, two = names[first[worst]], names[second[worst]]
                raise MissionError(
                    f"{one} and {two} would be {distances[worst]:.3g} m apart, {time:.1f} s from "
                    f"now; expected at least {limits[worst]:.3g} m{self._reasons(one, two)}"
                )
        self._check_speeds(names, times, places)

    def _check_speeds(self, names, times, places):
        """Refuse what the fleet would hold, which extrapolates positions."""
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
                        f"less than {pair.limit:.3g} m; expected slower ways, or others"
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
