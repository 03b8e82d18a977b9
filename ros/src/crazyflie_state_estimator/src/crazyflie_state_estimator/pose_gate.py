"""Which poses of a vehicle are believed."""

import math
from collections.abc import Sequence
from enum import Enum

PERSISTENCE = 0.3
"""A place that is too far away is believed in after the vehicle has been seen there so long, s:
somebody has carried it while nobody looked."""

LONGEST_WAY = 0.5
"""For how much time a vehicle that was not seen is believed to have flown on, s."""

CONFIRMATION = 3
"""So many poses in a row, without a jump between them, are believed after wild ones: a few of
many always come to lie where the vehicle might be."""

MOMENT = 0.03
"""So long after a good pose one alone is believed, s: the vehicle cannot have gone far."""

SLACK = 0.02
"""What noise may move a pose by, m."""


Pose = tuple[float, tuple[float, ...]]
"""Time, s, and position, m."""


class Verdict(Enum):
    """What is to be done with a pose."""

    GOOD = "good"
    BAD = "bad"
    MOVED = "moved"
    """Good, but the vehicle did not fly there: velocities begin anew."""


class PoseGate:
    """Rejects poses that the vehicle cannot have flown to.

    Attributes
    ----------
    rejected : int
        How many.
    max_speed : float

    Parameters
    ----------
    max_speed : float
        The fastest that a vehicle flies, m/s.
    """

    def __init__(self, max_speed: float):
        self.rejected = 0
        self.max_speed = max_speed
        self.reset()

    def reset(self) -> None:
        """Believe the next pose."""
        # The last pose that was believed, the last one that came, and how long the latter
        # has gone on without a jump: since when, and for how many poses.
        self._last: Pose | None = None
        self._previous: Pose | None = None
        self._since = 0.0
        self._count = 0
        self._is_doubtful = False

    def judge(self, time: float, position: Sequence[float]) -> Verdict:
        """Return what to do with a pose.

        Parameters
        ----------
        time : float
            Its stamp, s, later than the last one's; an earlier one begins anew.
        position : sequence, 3 components
            m.
        """
        pose = (time, tuple(position))
        if self._last is None or time < self._last[0]:
            self.reset()
            self._last = self._previous = pose
            return Verdict.GOOD
        if self._previous is None or not self._is_reachable(self._previous, pose):
            self._since = time
            self._count = 0
        self._previous = pose
        self._count += 1
        is_recent = not self._is_doubtful or time - self._last[0] < MOMENT
        is_steady = is_recent or self._count >= CONFIRMATION
        if is_steady and self._is_reachable(self._last, pose):
            self._believe(pose)
            return Verdict.GOOD
        if time - self._since >= PERSISTENCE - 1e-6:
            self._believe(pose)
            return Verdict.MOVED
        self._is_doubtful = True
        self.rejected += 1
        return Verdict.BAD

    def _believe(self, pose):
        self._last = pose
        self._is_doubtful = False

    def _is_reachable(self, start, end):
        way = self.max_speed * min(end[0] - start[0], LONGEST_WAY) + SLACK
        return math.dist(start[1], end[1]) <= way


class TiltMonitor:
    """Tells whether the vehicle has tipped over.

    One pose alone is no evidence: motion capture may mistake one marker for another.

    Parameters
    ----------
    max_tilt : float
        rad.
    """

    _POSES = 5

    def __init__(self, max_tilt: float):
        self.max_tilt = max_tilt
        self._count = 0
        self._is_tilted = False

    def update(self, x: float, y: float) -> bool:
        """Return whether it has, after the next pose.

        Parameters
        ----------
        x, y : float
            Of its unit quaternion.
        """
        # The cosine of the angle between the vehicle's z axis and that of the fixed frame.
        is_tilted = 1.0 - 2.0 * (x * x + y * y) < math.cos(self.max_tilt)
        self._count = 0 if is_tilted == self._is_tilted else self._count + 1
        if self._count >= self._POSES:
            self._is_tilted = is_tilted
            self._count = 0
        return self._is_tilted
