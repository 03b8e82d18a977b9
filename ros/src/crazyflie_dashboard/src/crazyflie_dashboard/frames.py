"""Poses of all frames of /tf, decoded as often as they are shown, not as often as they arrive."""

import struct
from collections import Counter
from collections.abc import Callable, Hashable
from dataclasses import dataclass

from crazyflie_dashboard.snapshot import Rotation, Triple
from crazyflie_utils import TransformError
from crazyflie_utils.tf.frame_tree import FrameTree, StampedPose, decode_pose, entries

_MAX_FRAMES = 1000
_FORGET_AFTER = 30.0  #: Time without a pose after which a moving frame is not shown (s).


@dataclass
class Pose:
    """The latest pose of a frame in its parent.

    ``arrival`` (s) is when its stamp was first seen, by the clock of `Frames`; ``delay`` (s) how
    old the stamp was then. ``velocity`` (m/s) is the mean since the pose before.
    """

    stamped: StampedPose
    arrival: float
    delay: float
    velocity: Triple = (0.0, 0.0, 0.0)
    rate: float = 0.0
    is_static: bool = False


class Frames:
    """The frames of /tf and /tf_static, by the rules that nodes follow.

    ``time()`` is the machine's (s), ``nanoseconds()`` is ROS time, and ``ahead`` (s) the longest
    time by which a stamp may be ahead of it.
    """

    def __init__(self, time: Callable[[], float], nanoseconds: Callable[[], int], ahead: float):
        self.poses: dict[str, Pose] = {}
        #: Frame whose newest pose was rejected -> reason.
        self.rejected: dict[str, str] = {}
        self._time, self._nanoseconds, self._ahead = time, nanoseconds, ahead
        self._latest: dict[str, bytes] = {}
        self._counts: Counter[str] = Counter()
        self._counted_since = time()
        self.clear()

    def clear(self) -> None:
        """Forget all frames."""
        for known in (self.poses, self.rejected, self._latest, self._counts):
            known.clear()
        self._tree = FrameTree(self._on_rejected, self._ahead)

    def read(self, raw: bytes) -> None:
        """Store a serialized tf2_msgs/TFMessage."""
        try:
            for child, entry in entries(raw):
                if child in self._latest or len(self._latest) < _MAX_FRAMES:
                    self._latest[child] = entry
                    self._counts[child] += 1
        except (struct.error, ValueError):
            # The doctor reports that; a display cannot correct it.
            return

    def read_static(self, pose: StampedPose) -> None:
        """Store a static pose."""
        self._tree.take_static(pose, self._nanoseconds())
        self.poses[pose.child] = Pose(pose, self._time(), 0.0, is_static=True)

    def update(self) -> None:
        """Decode the messages that have come since the last call."""
        now, moment = self._time(), self._nanoseconds()
        elapsed = now - self._counted_since
        for child, entry in self._latest.items():
            pose = decode_pose(entry)
            if self._tree.take(pose, moment):
                self._on_new(pose, now, moment)
            if elapsed >= 1.0 and child in self.poses:
                self.poses[child].rate = self._counts[child] / elapsed
        self._latest.clear()
        if elapsed >= 1.0:
            self._counts.clear()
            self._counted_since = now
            old = now - _FORGET_AFTER
            for name in [n for n, p in self.poses.items() if p.arrival < old and not p.is_static]:
                del self.poses[name]
                self.rejected.pop(name, None)

    def age(self, name: str) -> float:
        """Return the age of the pose of a frame, s."""
        pose = self.poses[name]
        return pose.delay + self._time() - pose.arrival

    def parent(self, name: str | None) -> str | None:
        """Return the frame right above a frame; None if it is not known."""
        pose = None if name is None else self.poses.get(name)
        return None if pose is None else pose.stamped.parent

    def home(self, name: str | None) -> str | None:
        """Return the frame in which a frame moves: above the topmost one that is not static."""
        found = None
        for each in self._tree.chain(name):
            pose = self.poses.get(each)
            if pose is not None and not pose.is_static:
                found = pose.stamped.parent
        return found

    def root(self, name: str) -> str:
        """Return the frame at the top of a frame's tree."""
        *_, top = self._tree.chain(name)
        return top

    def in_fixed(self, name: str, fixed: str) -> tuple[Triple, Rotation] | None:
        """Return position and rotation of a frame in another one; None if that is not known."""
        if name == fixed:
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
        if name not in self.poses:
            return None
        try:
            pose = self._tree.lookup(fixed, name)
        except TransformError:
            return None
        return pose.position, pose.rotation

    def _on_new(self, stamped, now, moment):
        known = self.poses.get(stamped.child)
        delay = max(moment - stamped.stamp, 0) * 1e-9
        pose = Pose(stamped, now, delay)
        if known is not None:
            pose.velocity, pose.rate = _velocity(known, pose), known.rate
        self.poses[stamped.child] = pose
        self.rejected.pop(stamped.child, None)

    def _on_rejected(self, text: str, key: Hashable) -> None:
        if isinstance(key, tuple):
            _, child, reason = key
            self.rejected[child] = reason


def _velocity(before: Pose, now: Pose) -> Triple:
    elapsed = (now.stamped.stamp - before.stamped.stamp) * 1e-9
    if elapsed <= 0.0:
        return before.velocity
    (x, y, z), (a, b, c) = now.stamped.position, before.stamped.position
    return (x - a) / elapsed, (y - b) / elapsed, (z - c) / elapsed
