"""tf for a process: one tf2 buffer and one broadcaster, however many nodes.

What comes from other processes is decoded only where somebody in this one looks it up: the
frames that were asked for, and those above them in the tree. Of the others the last transform
is kept as it came, for whoever asks later.
"""

import math
import struct
import threading
from collections import Counter
from collections.abc import Callable, Hashable, Iterator
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
"""Names of frames that are told to tf2, and frames that are kept for later."""

_MOST_BYTES = 1024
"""Of a transform that is kept for later."""

_LENGTH = struct.Struct("<I")
_HEADER = struct.Struct("<4I")  # Sequence number, s, ns, length of the parent's name.
_POSE = struct.Struct("<7d")


class TransformError(Exception):
    """tf does not know the transform between two frames; the text says why."""


class RawTransforms(TFMessage):
    """A tf2_msgs/TFMessage as it came, which is decoded when it is asked for its transforms.

    Attributes
    ----------
    raw : bytes
        The serialized message.
    """

    __slots__ = ("raw",)
    each_counts = True

    def __init__(self) -> None:
        self.raw = _LENGTH.pack(0)

    def deserialize(self, data: bytes) -> "RawTransforms":
        """Keep the serialized message."""
        self.raw = data
        return self

    @property
    def transforms(self) -> list[TransformStamped]:
        """All transforms of the message."""
        return TFMessage().deserialize(self.raw).transforms


class _Stamp:
    """A genpy.Time as far as tf2 needs it, made in a quarter of the time."""

    __slots__ = ("nsecs", "secs")

    def __init__(self, secs: int, nsecs: int):
        self.secs = secs
        self.nsecs = nsecs

    def to_sec(self) -> float:
        """Return seconds, as genpy.Time does."""
        return self.secs + self.nsecs / 1e9


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
        self._stamps: dict[float, genpy.Time | _Stamp] = {}
        # Each broadcaster outside has a thread of its own.
        self._lock = threading.RLock()
        self._names: set[str] = set()
        self._parents: dict[str, str] = {}
        self._followed: set[str] = set()
        # The same as they may be on the wire; and names that nobody may use.
        self._wanted = {b"", b"/"}
        self._unread: dict[bytes, bytes] = {}
        self._scratch = TransformStamped()
        self._decoded_names: dict[bytes, tuple[str, str]] = {}

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
            self._topics.subscribe("/tf", TFMessage, self._on_transforms, RawTransforms)
            self._topics.subscribe("/tf_static", TFMessage, self._on_static)

    def clear(self) -> None:
        """Forget everything: time has been reset."""
        if self._buffer is not None:
            with self._lock:
                self._buffer.clear()
                self._stamps.clear()
                self._latest.clear()
                self._steps_back.clear()
                self._unread.clear()

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
        if target not in self._followed or source not in self._followed:
            with self._lock:
                self._follow(target)
                self._follow(source)
        try:
            found = self._buffer.lookup_transform_core(target, source, _LATEST)
        except tf2_ros.TransformException as error:
            raise TransformError(str(error)) from None
        stamp = found.header.stamp
        exact = self._stamps.get(stamp.to_sec(), stamp)
        found.header.stamp = genpy.Time(exact.secs, exact.nsecs)
        return found

    def _on_transforms(self, message):
        now = self._now()
        with self._lock:
            if isinstance(message, RawTransforms):
                self._read(message.raw, now)
            else:
                for transform in message.transforms:
                    self._take(transform, now)

    def _on_static(self, message):
        with self._lock:
            for transform in message.transforms:
                reason = _why_invalid(transform) or self._why_too_many(transform)
                if reason is None:
                    self._buffer.set_transform_static(transform, "tf")
                    self._remember(transform, transform.header.stamp.to_sec())
                else:
                    self._reject(transform, reason)

    def _read(self, raw, now):
        try:
            for child, start, end in _entries(raw):
                if child in self._wanted:
                    self._take(self._decode(raw, start, end), now)
                elif end - start <= _MOST_BYTES:
                    self._unread[child] = raw[start:end]
                    if len(self._unread) > _MOST_FRAMES:
                        del self._unread[next(iter(self._unread))]
        except (struct.error, ValueError):
            self.rejected["cannot be read"] += 1
            self._warn("ignoring a message on /tf that cannot be read", "cannot be read")

    def _decode(self, raw, start, end):
        # tf2 copies what it is given, so that one object serves for all.
        transform = self._scratch
        _, seconds, nanoseconds, length = _HEADER.unpack_from(raw, start)
        transform.header.stamp = _Stamp(seconds, nanoseconds)
        names = raw[start + _HEADER.size - _LENGTH.size : end - _POSE.size]
        if names not in self._decoded_names:
            if len(self._decoded_names) >= _MOST_FRAMES:
                self._decoded_names.clear()
            self._decoded_names[names] = (
                names[_LENGTH.size : _LENGTH.size + length].decode().removeprefix("/"),
                names[2 * _LENGTH.size + length :].decode().removeprefix("/"),
            )
        transform.header.frame_id, transform.child_frame_id = self._decoded_names[names]
        t, q = transform.transform.translation, transform.transform.rotation
        t.x, t.y, t.z, q.x, q.y, q.z, q.w = _POSE.unpack_from(raw, end - _POSE.size)
        return transform

    def _take(self, transform, now):
        stamp = transform.header.stamp.to_sec()
        reason = (
            _why_invalid(transform)
            or self._why_too_many(transform)
            or self._why_untimely(transform.child_frame_id, stamp, now)
        )
        if reason is None:
            self._buffer.set_transform(transform, "tf")
            self._remember(transform, stamp)
        elif reason:
            self._reject(transform, reason)

    def _follow(self, frame):
        """Have a frame and all above it decoded from now on."""
        while frame not in self._followed and len(self._followed) < _MOST_FRAMES:
            for name in (frame.encode(), b"/" + frame.encode()):
                self._wanted.add(name)
                kept = self._unread.pop(name, None)
                if kept is not None:
                    self._read(_LENGTH.pack(1) + kept, self._now())
            # Not before, or a long chain would be followed by recursion.
            self._followed.add(frame)
            frame = self._parents.get(frame, frame)

    def _reject(self, transform, reason):
        self.rejected[reason] += 1
        parent, child = transform.header.frame_id, transform.child_frame_id
        text = f"ignoring a transform {parent[:50]} -> {child[:50]} that {reason}"
        self._warn(text, (parent, child, reason))

    def _why_untimely(self, frame, stamp, now):
        """Return why a transform must not be taken now; "" if it is known already."""
        if stamp > now + self._ahead:
            return "is stamped in the future"
        latest = self._latest.get(frame)
        if stamp == latest:
            return ""
        if latest is not None and stamp < latest - _STEP_BACK:
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

    def _why_too_many(self, transform):
        # tf2 never forgets a name.
        parent, child = transform.header.frame_id, transform.child_frame_id
        if (parent in self._names and child in self._names) or len(self._names) < _MOST_FRAMES:
            return None
        return "is one frame too many"

    def _remember(self, transform, stamp):
        self._stamps[stamp] = transform.header.stamp
        if len(self._stamps) > _MOST_STAMPS:
            del self._stamps[next(iter(self._stamps))]
        parent, child = transform.header.frame_id, transform.child_frame_id
        if parent[0] == "/" or child[0] == "/":
            parent, child = parent.removeprefix("/"), child.removeprefix("/")
        if self._parents.get(child) != parent:
            self._names.update((parent, child))
            self._parents[child] = parent
            if child in self._followed:
                self._follow(parent)


def _entries(raw: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Yield child frame, start and end of every transform of a serialized TFMessage.

    Raises
    ------
    struct.error, ValueError
        It is shorter than it says.
    """
    (count,) = _LENGTH.unpack_from(raw)
    start = _LENGTH.size
    for _ in range(count):
        parent = start + _HEADER.size + _LENGTH.unpack_from(raw, start + 12)[0]
        child = parent + _LENGTH.size + _LENGTH.unpack_from(raw, parent)[0]
        end = child + _POSE.size
        if end > len(raw):
            raise ValueError
        yield raw[parent + _LENGTH.size : child], start, end
        start = end


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
