"""Poses of all frames of /tf, decoded as often as they are shown and not as often as they come."""

import math
import struct
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from crazyflie_dashboard.snapshot import Rotation, Triple
from crazyflie_model.angles import rotate
from crazyflie_utils.tf.poses import PoseCodec, entries

_MAX_DEPTH = 10  #: Frames above a frame that are followed: a loop has no end.

_MAX_FRAMES = 1000
_MIN_SQUARE, _MAX_SQUARE = 0.8, 1.2  #: Of the length of a quaternion, squared.


@dataclass
class Pose:
    """The latest pose of a frame in its parent.

    ``arrival`` (s) is when its stamp was first seen, by the clock of `Frames`; ``delay`` (s) how
    old the stamp was then. ``velocity`` (m/s) is the mean since the pose before.
    """

    parent: str
    position: Triple
    rotation: Rotation
    stamp: int
    arrival: float
    delay: float
    velocity: Triple = (0.0, 0.0, 0.0)
    rate: float = 0.0


class Frames:
    """The frames of /tf.

    Parameters
    ----------
    time : callable
        The machine's time, s.
    nanoseconds : callable
        ROS time, ns.
    """

    def __init__(self, time: Callable[[], float], nanoseconds: Callable[[], int]):
        self.poses: dict[str, Pose] = {}
        #: Frames whose newest pose is no pose -> when it came, s.
        self.rejected: dict[str, float] = {}
        self._time, self._nanoseconds = time, nanoseconds
        self._codec = PoseCodec()
        self._latest: dict[bytes, tuple[bytes, int, int]] = {}
        self._counts: Counter[bytes] = Counter()
        self._counted_since = time()

    def clear(self) -> None:
        """Forget all frames."""
        for known in (self.poses, self.rejected, self._latest, self._counts):
            known.clear()

    def read(self, raw: bytes) -> None:
        """Take a serialized tf2_msgs/TFMessage."""
        try:
            for child, start, end in entries(raw):
                if child in self._latest or len(self._latest) < _MAX_FRAMES:
                    self._latest[child] = raw, start, end
                    self._counts[child] += 1
        except (struct.error, ValueError):
            # The doctor says so; a display has nothing to do about it.
            return

    def update(self) -> None:
        """Decode what has come since the last time."""
        now = self._time()
        elapsed = now - self._counted_since
        for child, (raw, start, end) in self._latest.items():
            try:
                parent, name, stamp, position, rotation = self._codec.decode(raw, start, end)
            except (UnicodeDecodeError, struct.error):
                continue
            known = self.poses.get(name)
            if known is not None and known.stamp == stamp:
                continue
            if not _is_pose(position, rotation):
                # The pose before stays, and grows old.
                self.rejected[name] = now
                continue
            self.rejected.pop(name, None)
            delay = max(self._nanoseconds() - stamp, 0) * 1e-9
            pose = Pose(parent, position, rotation, stamp, now, delay)
            if known is not None:
                pose.velocity, pose.rate = _velocity(known, pose), known.rate
            self.poses[name] = pose
            if elapsed >= 1.0:
                pose.rate = self._counts[child] / elapsed
        self._latest.clear()
        if elapsed >= 1.0:
            self._counts.clear()
            self._counted_since = now

    def age(self, name: str) -> float:
        """Return how old the pose of a frame is, s."""
        pose = self.poses[name]
        return pose.delay + self._time() - pose.arrival

    def parent(self, name: str | None) -> str | None:
        """Return the frame right above a frame; None if it is not known."""
        pose = None if name is None else self.poses.get(name)
        return None if pose is None else pose.parent

    def root(self, name: str) -> str:
        """Return the frame at the top of a frame's tree."""
        for _ in range(_MAX_DEPTH):
            if name not in self.poses:
                break
            name = self.poses[name].parent
        return name

    def in_fixed(self, name: str, fixed: str) -> tuple[Triple, Rotation] | None:
        """Return position and rotation of a frame in another above it; None if it is not."""
        pose = self.poses.get(name)
        if pose is None:
            return None
        position, rotation = pose.position, pose.rotation
        for _ in range(_MAX_DEPTH):
            if pose.parent == fixed:
                return position, rotation
            pose = self.poses.get(pose.parent)
            if pose is None:
                return None
            x, y, z = rotate(pose.rotation, position)
            a, b, c = pose.position
            position, rotation = (a + x, b + y, c + z), _product(pose.rotation, rotation)
        return None


def _is_pose(position: Triple, rotation: Rotation) -> bool:
    """Tell whether a position is finite and a quaternion has a length near 1."""
    square = sum(each * each for each in rotation)
    return all(map(math.isfinite, position)) and _MIN_SQUARE < square < _MAX_SQUARE


def _velocity(before: Pose, now: Pose) -> Triple:
    elapsed = (now.stamp - before.stamp) * 1e-9
    if elapsed <= 0.0:
        return before.velocity
    (x, y, z), (a, b, c) = now.position, before.position
    return (x - a) / elapsed, (y - b) / elapsed, (z - c) / elapsed


def _product(one: Rotation, two: Rotation) -> Rotation:
    """Return the Hamilton product of two quaternions (x, y, z, w)."""
    (a, b, c, d), (x, y, z, w) = one, two
    return (
        d * x + a * w + b * z - c * y,
        d * y - a * z + b * w + c * x,
        d * z + a * y - b * x + c * w,
        d * w - a * x - b * y - c * z,
    )
