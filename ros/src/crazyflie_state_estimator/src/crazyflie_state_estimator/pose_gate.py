"""Rejection of poses that the vehicle cannot have flown to, and detection of tilt."""

import math
from collections.abc import Sequence
from enum import Enum

#: A position that is too far away is accepted after the vehicle has been measured there for this
#: time, s: it was carried there while it was not measured.
PERSISTENCE = 0.3

#: Longest time for which a vehicle that was not measured is assumed to have flown on, s.
MAX_COAST_TIME = 0.5

#: Number of poses in a row, without a jump between them, that are accepted after outliers: some
#: outliers happen to lie where the vehicle might be.
CONFIRMATION = 3

#: A single pose is accepted within this time after a good one, s: the vehicle cannot be far.
TRUST_WINDOW = 0.03
NOISE_MARGIN = 0.02  #: Largest displacement of a pose by noise, m.
Pose = tuple[float, tuple[float, ...]]  #: Time, s, and position, m.


class Classification(Enum):
    """How a pose is used."""

    GOOD = "good"
    BAD = "bad"
    MOVED = "moved"  #: Good, but the vehicle did not fly there: filters restart.


class PoseGate:
    """Rejects poses that a vehicle of ``max_speed`` (m/s) cannot have flown to, and counts them."""

    def __init__(self, max_speed: float):
        self.rejected = 0
        self.max_speed = max_speed
        self.reset()

    def reset(self) -> None:
        """Accept the next pose."""
        # The last accepted pose, the last one received, and since when and for how many poses
        # the latter have had no jump.
        self._last: Pose | None = None
        self._previous: Pose | None = None
        self._since = 0.0
        self._count = 0
        self._is_doubtful = False

    def classify(self, time: float, position: Sequence[float]) -> Classification:
        """Classify a pose by its position (m) and stamp (s); an earlier one resets the gate."""
        pose = (time, tuple(position))
        if self._last is None or time < self._last[0]:
            self.reset()
            self._last = self._previous = pose
            return Classification.GOOD
        if self._previous is None or not self._is_reachable(self._previous, pose):
            self._since = time
            self._count = 0
        self._previous = pose
        self._count += 1
        is_recent = not self._is_doubtful or time - self._last[0] < TRUST_WINDOW
        is_steady = is_recent or self._count >= CONFIRMATION
        if is_steady and self._is_reachable(self._last, pose):
            self._accept(pose)
            return Classification.GOOD
        if time - self._since >= PERSISTENCE - 1e-6:
            self._accept(pose)
            return Classification.MOVED
        self._is_doubtful = True
        self.rejected += 1
        return Classification.BAD

    def _accept(self, pose):
        self._last = pose
        self._is_doubtful = False

    def _is_reachable(self, start, end):
        way = self.max_speed * min(end[0] - start[0], MAX_COAST_TIME) + NOISE_MARGIN
        return math.dist(start[1], end[1]) <= way


class TiltMonitor:
    """Detects that the vehicle has tipped over by more than ``max_tilt`` (rad).

    A single pose is not enough: motion capture may mistake one marker for another.
    """

    _POSES = 5

    def __init__(self, max_tilt: float):
        self.max_tilt = max_tilt
        self._count = 0
        self._is_tilted = False

    def update(self, x: float, y: float) -> bool:
        """Return whether it has, after the next pose; x, y are of its unit quaternion."""
        # The cosine of the angle between the vehicle's z axis and that of the fixed frame.
        is_tilted = 1.0 - 2.0 * (x * x + y * y) < math.cos(self.max_tilt)
        self._count = 0 if is_tilted == self._is_tilted else self._count + 1
        if self._count >= self._POSES:
            self._is_tilted = is_tilted
            self._count = 0
        return self._is_tilted
