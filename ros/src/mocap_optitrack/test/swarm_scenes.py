"""Markers of vehicles that fly a swap, with noise, occlusions and reflections."""

import itertools
import math

import numpy as np

RATE = 100.0
"""Frames per second."""


BEGIN = 0.6
"""From then on positions count, s: the vehicles rest before."""


class SwapFlight:
    """Vehicles that take off from a circle, fly to the opposite points, and land there.

    They fly around the middle, all in the same sense, from rest to rest.

    Parameters
    ----------
    n : int
    spacing : float
        From one start point to the next, m.
    """

    HOVER = 1.0
    GROUND_TIME = 0.8
    CLIMB_TIME = 1.5

    def __init__(self, n, spacing=0.5):
        self._angles = 2.0 * math.pi * np.arange(n) / n
        self._radius = max(0.5 * spacing / math.sin(math.pi / n), 0.3) if n > 1 else 0.5
        self._duration = max(3.0, 4.2 * self._radius)
        self.end = 2.0 * (self.GROUND_TIME + self.CLIMB_TIME) + self._duration

    @property
    def starts(self):
        """Positions of the markers at the beginning, (n, 3), m."""
        return self.positions(0.0)

    def positions(self, time):
        """Return the true positions of the markers, (n, 3), m."""
        begin = self.GROUND_TIME
        up = _rest_to_rest((time - begin) / self.CLIMB_TIME)
        begin += self.CLIMB_TIME
        turned = _rest_to_rest((time - begin) / self._duration)
        begin += self._duration
        up -= _rest_to_rest((time - begin) / self.CLIMB_TIME)
        # Every second one flies nearer to the middle, and all turn by half a circle.
        radius = self._radius * (
            1.0 - 0.3 * (np.arange(len(self._angles)) % 2) * 4 * turned * (1 - turned)
        )
        angles = self._angles + math.pi * turned
        height = np.full(len(angles), 0.04 + self.HOVER * up)
        return np.column_stack((radius * np.cos(angles), radius * np.sin(angles), height))


def _rest_to_rest(fraction):
    s = min(max(fraction, 0.0), 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


class Cameras:
    """Markers as seen by cameras: in any order, with noise, reflections and occlusions.

    Parameters
    ----------
    seed : int
    noise : float
        Standard deviation along each axis, m; errors beyond 2.5 of them are cut off.
    dropout : float
        Probability with which a marker is missing in a frame.
    occlusions : sequence of tuple
        (marker, begin, duration), s.
    flashes : float
        Mean number of reflections in a frame, anywhere.
    reflections : sequence of (3,) arrays
        Reflections that are always there, m.
    """

    def __init__(
        self, seed=0, noise=0.0005, dropout=0.0, occlusions=(), flashes=0.0, reflections=()
    ):
        self._random = np.random.default_rng(seed)
        self._noise, self._dropout = noise, dropout
        self._occlusions, self._flashes = occlusions, flashes
        self._reflections = np.reshape(reflections, (-1, 3))

    def see(self, time, positions):
        """Return the points of a frame, (k, 3), m."""
        random = self._random
        seen = random.random(len(positions)) >= self._dropout
        for marker, begin, duration in self._occlusions:
            if marker < len(seen) and begin <= time < begin + duration:
                seen[marker] = False
        low, high = positions.min(axis=0) - 0.3, positions.max(axis=0) + 0.3
        flashes = random.uniform(low, high, (random.poisson(self._flashes), 3))
        points = np.vstack((positions[seen], flashes, self._reflections))
        errors = np.clip(random.normal(size=points.shape), -2.5, 2.5)
        points = points + self._noise * errors
        return random.permutation(points)


class Score:
    """How well a tracker did.

    Attributes
    ----------
    frames : int
        Vehicles times frames.
    seen : int
        Of these, those in which the marker was in the frame.
    tracked : int
        Positions that are the vehicle's.
    swaps, ghosts : int
        Positions that are another vehicle's, and no vehicle's.
    """

    def __init__(self):
        self.frames = self.tracked = self.swaps = self.ghosts = 0

    def add(self, name, found, positions, own):
        """Count a position that was found (None for none), of a vehicle at ``positions[own]``."""
        self.frames += 1
        if found is None:
            return
        errors = np.linalg.norm(positions - np.array(found), axis=1)
        if errors[own] < 0.02:
            self.tracked += 1
        elif errors.min() < 0.02:
            self.swaps += 1
        else:
            self.ghosts += 1


def fly(flight, cameras, update):
    """Run a tracker on a flight; return its score.

    ``update(time, points)`` returns name -> position; vehicles are named by their numbers.
    """
    score = Score()
    for k in itertools.count(1):
        time = k / RATE
        if time > flight.end:
            return score
        positions = flight.positions(time)
        found = update(time, cameras.see(time, positions))
        if time < BEGIN:
            continue
        for own in range(len(positions)):
            score.add(str(own), found.get(str(own)), positions, own)
