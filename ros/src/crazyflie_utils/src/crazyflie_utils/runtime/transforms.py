"""tf for a process, however many nodes.

What comes from other processes is decoded only where somebody in this one looks it up: the
frames that were asked for, and those above them in the tree. Of the others the last transform
is kept as it came, for whoever asks later.

Nearly every look-up is of the latest pose of a frame in the one right above it, which is answered
here. tf2 has the others; it is begun, and told of what has come lately, at the first of them.
"""

import math
import struct
import threading
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Hashable
from typing import Any

import genpy
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from crazyflie_utils.runtime.poses import PoseCodec, RawTransforms, StampedPose, entries
from crazyflie_utils.runtime.topics import Subscriber, Topics

_LATEST = genpy.Time()

_CACHE = genpy.Duration(10.0)
"""What tf2 keeps, by its own default."""

_MOST_STAMPS = 10_000
"""Stamps that are remembered for tf2: the last ten seconds of a vehicle at 1 kHz."""

_HISTORY = 100
"""Poses of a frame that are kept for the moment when tf2 is begun."""

_NORM_TOLERANCE = 0.01
"""How far tf2 lets the squared norm of a quaternion be from 1."""


AHEAD = 0.2
"""How far a stamp may be ahead of now, s. tf's static_transform_publisher stamps 0.1 s ahead."""

SIMULATED_AHEAD = 2.0
"""The same in simulated time: pose and /clock come by different ways."""

_STEP_BACK = 100_000_000
"""A stamp that is older than the last one of its frame by less than this, ns, came by a slower
way; the present pose is still the younger one."""

_STEPS_BACK = 3
"""So many of them in a row, and the source's clock has been set back."""

_MOST_FRAMES = 1000
"""Names of frames that are known, and frames that are kept for later."""

_MOST_BYTES = 1024
"""Of a transform that is kept for later."""

_ONE = b"\x01\0\0\0"
"""The length of a message with one transform."""


class TransformError(Exception):
    """tf does not know the transform between two frames; the text says why."""


class _Frame:
    """What is known of a frame that moves."""

    __slots__ = ("latest", "recent", "steps_back")

    def __init__(self, pose: StampedPose):
        self.latest = pose
        self.recent: deque[StampedPose] = deque(maxlen=_HISTORY)
        self.steps_back = 0


class _Listener:
    """Somebody who is told of new poses of a frame, so often and no oftener.

    Parameters
    ----------
    period : float
        s, by the poses' stamps.
    tell : callable
    """

    def __init__(self, period: float, tell: Callable[[], None]):
        self.tell = tell
        self._period = round(period * 1e9)
        self._due = 0

    def is_due(self, stamp: int) -> bool:
        """Tell whether a pose, by its stamp in ns, is one of those to be told of."""
        early = self._due - stamp
        # Rounding makes none late by one pose; much earlier ones are of a clock that was set back.
        if self._period // 100 < early <= 2 * self._period:
            return False
        self._due = stamp + self._period if early > 0 else max(self._due + self._period, stamp)
        return True


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
        Returns the present ROS time, ns.
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
        now: Callable[[], int],
        ahead: float,
    ):
        self.rejected: Counter[str] = Counter()
        self._topics = topics
        self._warn = warn
        self._now = now
        self._ahead = round(ahead * 1e9)
        self._codec = PoseCodec()
        self._publisher: Any = None
        self._own: TFMessage | None = None
        self._broadcasters = 0
        self._gathered: list[StampedPose] | None = None
        self._subscriber: Subscriber | None = None
        self._listeners: dict[str, list[_Listener]] = {}
        self._arrived: list[_Listener] = []
        self._sources: list[Callable[[], None]] = []
        # Each broadcaster outside has a thread of its own.
        self._lock = threading.RLock()
        self._frames: dict[str, _Frame] = {}
        self._static: dict[str, StampedPose] = {}
        self._names: set[str] = set()
        self._followed: set[str] = set()
        # The same as they may be on the wire; and names that nobody may use.
        self._wanted = {b"", b"/"}
        self._unread: dict[bytes, bytes] = {}
        self._tf2: Any = None
        # tf2's Python buffer keeps stamps as floats, to 0.1 us; this gives them back
        # as they came.
        self._stamps: OrderedDict[float, int] = OrderedDict()

    def advertise(self) -> None:
        """Announce that one more in this process will broadcast."""
        self._broadcasters += 1
        if self._publisher is None:
            self._publisher = self._topics.publisher("/tf", TFMessage, latch=False)

    def on_lookup(self, refresh: Callable[[], None]) -> None:
        """Have ``refresh()`` called before poses are looked up."""
        self._sources.append(refresh)

    def is_heard(self) -> bool:
        """Tell whether poses that are broadcast go anywhere but into look-ups of this process."""
        beside = int(self._subscriber is not None)
        return bool(self._listeners) or self._publisher.has_subscribers(beside)

    def broadcast(self, transforms: list[TransformStamped]) -> None:
        """Publish a list of geometry_msgs/TransformStamped on /tf."""
        self._publisher.publish(TFMessage(transforms))

    def broadcast_poses(self, poses: list[StampedPose]) -> None:
        """Publish poses on /tf; a message is made only if anybody else gets it."""
        if self._subscriber is not None:
            now = self._now()
            with self._lock:
                for pose in poses:
                    self._take(pose, now)
            self._tell_of_arrivals()
        if not self._publisher.has_subscribers(beside=int(self._subscriber is not None)):
            return
        if self._gathered is None:
            self._send(poses)
        else:
            self._gathered += poses

    def gather(self) -> None:
        """Keep the poses that several broadcast from now on for one message."""
        if self._broadcasters > 1 and self._gathered is None:
            self._gathered = []

    def send_gathered(self) -> None:
        """Publish what has been gathered; from now on each broadcast is a message again."""
        poses, self._gathered = self._gathered, None
        if poses:
            self._send(poses)

    def _send(self, poses):
        self._own = self._codec.encode(poses)
        self._publisher.publish(self._own)

    def listen(self) -> None:
        """Begin to collect what is said on /tf and /tf_static."""
        if self._subscriber is None:
            self._subscriber = self._topics.subscribe(
                "/tf", TFMessage, self._on_transforms, RawTransforms
            )
            self._subscriber.read_lazily(True)
            self._topics.subscribe("/tf_static", TFMessage, self._on_static)

    def on_pose(self, frame: str, period: float, tell: Callable[[], None]) -> None:
        """Have ``tell()`` called when a pose of a frame is new; once in ``period`` (s)."""
        self.listen()
        if self._subscriber is not None:
            self._subscriber.read_lazily(False)
        with self._lock:
            self._listeners.setdefault(frame, []).append(_Listener(period, tell))
            self._follow(frame)

    def clear(self) -> None:
        """Forget everything that moves: time has been reset."""
        with self._lock:
            self._frames.clear()
            self._unread.clear()
            self._stamps.clear()
            if self._tf2 is not None:
                self._tf2.clear()

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
        return self.lookup_pose(target, source).message()

    def lookup_pose(self, target: str, source: str) -> StampedPose:
        """Return the same as `lookup`, as a pose, which is quicker."""
        for refresh in self._sources:
            refresh()
        if self._subscriber is not None:
            self._subscriber.collect()
        if target not in self._followed or source not in self._followed:
            with self._lock:
                self._follow(target)
                self._follow(source)
        frame = self._frames.get(source)
        if frame is not None and frame.latest.parent == target and source not in self._static:
            return frame.latest
        with self._lock:
            return self._ask_tf2(target, source)

    def _ask_tf2(self, target, source):
        # tf2 need not begin as long as it would know no answer.
        for name in (target, source):
            if name not in self._names and target != source:
                raise TransformError(f"frame {name} is not known; looked up {target} -> {source}")
        if not set(self._chain(target)) & set(self._chain(source)):
            raise TransformError(f"frames {target} and {source} are not connected")
        # Here, since most processes do without.
        import tf2_py

        if self._tf2 is None:
            self._begin_tf2(tf2_py.BufferCore(_CACHE))
        try:
            found = self._tf2.lookup_transform_core(target, source, _LATEST)
        except tf2_py.TransformException as error:
            raise TransformError(str(error)) from None
        pose = StampedPose.of(found)
        return pose._replace(stamp=self._stamps.get(found.header.stamp.to_sec(), pose.stamp))

    def _chain(self, name):
        """Yield a frame and all above it."""
        seen = set()
        while name is not None and name not in seen:
            yield name
            seen.add(name)
            name = self._parent(name)

    def _parent(self, name):
        if name in self._frames:
            return self._frames[name].latest.parent
        return self._static[name].parent if name in self._static else None

    def _begin_tf2(self, tf2):
        self._tf2 = tf2
        for pose in self._static.values():
            self._tell_tf2(pose, is_static=True)
        for frame in self._frames.values():
            for pose in frame.recent:
                self._tell_tf2(pose)
            frame.recent.clear()

    def _tell_tf2(self, pose, is_static=False):
        message = pose.message()
        tell = self._tf2.set_transform_static if is_static else self._tf2.set_transform
        tell(message, "tf")
        self._stamps[message.header.stamp.to_sec()] = pose.stamp
        if len(self._stamps) > _MOST_STAMPS:
            self._stamps.popitem(last=False)

    def _on_transforms(self, message):
        if message is self._own:
            return
        now = self._now()
        with self._lock:
            if isinstance(message, RawTransforms):
                self._read(message.raw, now)
            else:
                for transform in message.transforms:
                    self._take(StampedPose.of(transform), now)
        self._tell_of_arrivals()

    def _tell_of_arrivals(self):
        # Not under the lock, since what is done now may look poses up.
        if self._arrived:
            with self._lock:
                arrived, self._arrived = self._arrived, []
            for listener in arrived:
                listener.tell()

    def _on_static(self, message):
        with self._lock:
            for pose in map(StampedPose.of, message.transforms):
                reason = _why_invalid(pose) or self._why_too_many(pose)
                if reason is not None:
                    self._reject(pose, reason)
                    continue
                self._static[pose.child] = pose
                if self._tf2 is not None:
                    self._tell_tf2(pose, is_static=True)
                self._notice(pose)

    def _read(self, raw, now):
        try:
            for child, start, end in entries(raw):
                if child in self._wanted:
                    self._take(self._codec.decode(raw, start, end), now)
                elif end - start <= _MOST_BYTES:
                    self._unread[child] = raw[start:end]
                    if len(self._unread) > _MOST_FRAMES:
                        del self._unread[next(iter(self._unread))]
        except (struct.error, ValueError):
            self.rejected["cannot be read"] += 1
            self._warn("ignoring a message on /tf that cannot be read", "cannot be read")

    def _take(self, pose, now):
        frame = self._frames.get(pose.child)
        reason = _why_invalid(pose) or self._why_too_many(pose)
        if reason is None:
            reason = self._why_untimely(frame, pose.stamp, now)
        if reason:
            self._reject(pose, reason)
        if reason is not None:
            return
        # The frames may have been forgotten meanwhile.
        frame = self._frames.get(pose.child)
        if frame is None:
            frame = self._frames[pose.child] = _Frame(pose)
            self._notice(pose)
        if pose.stamp >= frame.latest.stamp:
            if pose.parent != frame.latest.parent:
                self._notice(pose)
            frame.latest = pose
            frame.steps_back = 0
            for listener in self._listeners.get(pose.child, ()):
                if listener.is_due(pose.stamp):
                    self._arrived.append(listener)
        if self._tf2 is None:
            frame.recent.append(pose)
        else:
            self._tell_tf2(pose)

    def _notice(self, pose):
        """Take note of names that are new."""
        self._names.update((pose.parent, pose.child))
        if pose.child in self._followed:
            self._follow(pose.parent)

    def _follow(self, frame):
        """Have a frame and all above it decoded from now on."""
        while frame is not None and frame not in self._followed:
            if len(self._followed) >= _MOST_FRAMES:
                return
            for name in (frame.encode(), b"/" + frame.encode()):
                self._wanted.add(name)
                kept = self._unread.pop(name, None)
                if kept is not None:
                    self._read(_ONE + kept, self._now())
            # Not before, or a long chain would be followed by recursion.
            self._followed.add(frame)
            frame = self._parent(frame)

    def _reject(self, pose, reason):
        self.rejected[reason] += 1
        text = f"ignoring a transform {pose.parent[:50]} -> {pose.child[:50]} that {reason}"
        self._warn(text, (pose.parent, pose.child, reason))

    def _why_untimely(self, frame, stamp, now):
        """Return why a pose must not be taken now; "" if it is known already."""
        if stamp > now + self._ahead:
            return "is stamped in the future"
        if frame is None:
            return None
        latest = frame.latest.stamp
        if stamp == latest:
            return ""
        if stamp < latest - _STEP_BACK:
            frame.steps_back += 1
            if frame.steps_back < _STEPS_BACK:
                return "is stamped in the past"
            # The clock of the source was set back, and the last pose of before would
            # stand until the stamps have caught up.
            self.clear()
        return None

    def _why_too_many(self, pose):
        # tf2 never forgets a name.
        names = self._names
        if (pose.parent in names and pose.child in names) or len(names) < _MOST_FRAMES:
            return None
        return "is one frame too many"


def _why_invalid(pose):
    # tf2 refuses all of them, too, but says so without a throttle.
    if not pose.child.strip("/") or not pose.parent.strip("/"):
        return "does not name its frames"
    (a, b, c), (x, y, z, w) = pose.position, pose.rotation
    if not math.isfinite(a + b + c + x + y + z + w):
        return "is not finite"
    if abs(x * x + y * y + z * z + w * w - 1.0) > _NORM_TOLERANCE:
        return "has no unit quaternion"
    return None
