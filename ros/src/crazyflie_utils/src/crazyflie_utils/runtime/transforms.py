"""tf for a process: one tf2 buffer and one broadcaster, however many nodes."""

import math
import threading
from collections import Counter
from collections.abc import Callable, Hashable
from typing import Any

import genpy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from crazyflie_utils.runtime.topics import Publisher, Topics

_LATEST = genpy.Time()

_MOST_STAMPS = 10_000
"""Stamps that are remembered: the last ten seconds of a vehicle at 1 kHz."""

_NORM_TOLERANCE = 0.01
"""How far tf2 lets the squared norm of a quaternion be from 1."""


AHEAD = 0.2
"""How far a stamp may be ahead of now, s. tf's static_transform_publisher stamps 0.1 s ahead."""

SIMULATED_AHEAD = 2.0
"""The same in simulated time: pose and /clock come by different ways."""

_STEP_BACK = 0.1
"""A stamp that is older than the last one of its frame by less than this, s, came by a slower
way; the present pose is still the younger one."""

_STEPS_BACK = 3
"""So many of them in a row, and the source's clock has been set back."""

_MOST_FRAMES = 1000


class TransformError(Exception):
    """tf does not know the transform between two frames; the text says why."""


class _Broadcaster(tf2_ros.TransformBroadcaster):
    """tf2's broadcaster on a publisher of this process."""

    def __init__(self, publisher: Publisher):
        self.pub_tf = publisher


class Transforms:
    """What tf knows, and the way to tell it more.

    Parameters
    ----------
    topics : Topics
        Of the process; /tf and /tf_static are among them.
    warn : callable
        ``warn(text, key)`` is called about every transform that is dropped; with the same key
        it is for the same reason.
    now : callable
        Returns the present ROS time, s.
    ahead : float
        How far the stamp of a transform may be ahead of it, s.

    Attributes
    ----------
    rejected : collections.Counter
        How many transforms were dropped, by reason.
    """

    def __init__(
        self,
        topics: Topics,
        warn: Callable[[str, Hashable], None],
        now: Callable[[], float],
        ahead: float,
    ):
        self.rejected: Counter[str] = Counter()
        self._topics = topics
        self._warn = warn
        self._now = now
        self._ahead = ahead
        self._latest: dict[str, float] = {}
        self._steps_back: Counter[str] = Counter()
        self._buffer: Any = None
        self._broadcaster: Any = None
        # tf2's Python buffer keeps stamps as floats, to 0.1 us; this gives them back
        # as they came.
        self._stamps: dict[float, genpy.Time] = {}
        self._lock = threading.Lock()

    def broadcast(self, transforms: list[TransformStamped]) -> None:
        """Publish a list of geometry_msgs/TransformStamped on /tf."""
        self._broadcaster.sendTransform(transforms)

    def advertise(self) -> None:
        """Announce that this process will `broadcast`."""
        if self._broadcaster is None:
            publisher = self._topics.publisher("/tf", TFMessage, latch=False)
            self._broadcaster = _Broadcaster(publisher)

    def listen(self) -> None:
        """Begin to collect what is said on /tf and /tf_static."""
        if self._buffer is None:
            self._buffer = tf2_ros.Buffer(debug=False)
            self._topics.subscribe("/tf", TFMessage, self._on_transforms)
            self._topics.subscribe("/tf_static", TFMessage, self._on_static)

    def clear(self) -> None:
        """Forget everything: time has been reset."""
        if self._buffer is not None:
            self._buffer.clear()
            self._stamps.clear()
            self._latest.clear()
            self._steps_back.clear()

    def lookup(self, target: str, source: str) -> TransformStamped:
        """Return the latest transform from ``source`` to ``target`` coordinates.

        Returns
        -------
        geometry_msgs/TransformStamped
            The pose of frame ``source`` in frame ``target``, with its own stamp.

        Raises
        ------
        TransformError
            A frame is unknown, or the two are not connected.
        """
        try:
            found = self._buffer.lookup_transform_core(target, source, _LATEST)
        except tf2_ros.TransformException as error:
            raise TransformError(str(error)) from None
        stamp = found.header.stamp
        found.header.stamp = self._stamps.get(stamp.to_sec(), stamp)
        return found

    def _on_transforms(self, message):
        now = self._now()
        for transform in message.transforms:
            reason = _why_invalid(transform) or self._why_untimely(transform, now)
            if reason is None:
                self._buffer.set_transform(transform, "tf")
                self._remember(transform.header.stamp)
            elif reason:
                self._reject(transform, reason)

    def _on_static(self, message):
        for transform in message.transforms:
            reason = _why_invalid(transform)
            if reason is None:
                self._buffer.set_transform_static(transform, "tf")
                self._remember(transform.header.stamp)
            else:
                self._reject(transform, reason)

    def _reject(self, transform, reason):
        self.rejected[reason] += 1
        parent, child = transform.header.frame_id, transform.child_frame_id
        text = f"ignoring a transform {parent[:50]} -> {child[:50]} that {reason}"
        self._warn(text, (parent, child, reason))

    def _why_untimely(self, transform, now):
        """Return why a transform must not be taken now; "" if it is known already."""
        stamp, frame = transform.header.stamp.to_sec(), transform.child_frame_id
        if stamp > now + self._ahead:
            return "is stamped in the future"
        latest = self._latest.get(frame)
        if latest is None:
            if len(self._latest) >= _MOST_FRAMES:
                return "is one frame too many"
        elif stamp == latest:
            return ""
        elif stamp < latest - _STEP_BACK:
            self._steps_back[frame] += 1
            if self._steps_back[frame] < _STEPS_BACK:
                return "is stamped in the past"
            # The clock of the source was set back, and tf2 would go on with the last pose of
            # before until the stamps have caught up.
            self.clear()
        if latest is None or stamp > latest or frame not in self._latest:
            self._latest[frame] = stamp
            self._steps_back[frame] = 0
        return None

    def _remember(self, stamp):
        # Each broadcaster outside has its own thread here.
        with self._lock:
            self._stamps[stamp.to_sec()] = stamp
            if len(self._stamps) > _MOST_STAMPS:
                del self._stamps[next(iter(self._stamps))]


def _why_invalid(transform):
    # tf2 refuses all of them, too, but says so without a throttle.
    if not transform.child_frame_id.strip("/") or not transform.header.frame_id.strip("/"):
        return "does not name its frames"
    t, q = transform.transform.translation, transform.transform.rotation
    if not math.isfinite(t.x + t.y + t.z + q.x + q.y + q.z + q.w):
        return "is not finite"
    if abs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0) > _NORM_TOLERANCE:
        return "has no unit quaternion"
    return None
