"""The tf frames of a process, and poses as they are sent.

A pose is a tuple, which takes a fraction of the time of a geometry_msgs/TransformStamped; it is
converted to a message only where one is needed.

Transforms of other processes are decoded only for frames that were looked up, and for those above
them in the tree. The last transform of every other frame is kept serialized.

Nearly every lookup is of the latest pose of a frame in its parent, which is answered here. The
others go to tf2, which is given the poses of a frame from its first such lookup on.
"""

import functools
import math
import struct
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterable, Iterator
from typing import BinaryIO, NamedTuple

import genpy
import tf2_py
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from crazyflie_utils.timers import ros_time

_LENGTH = struct.Struct("<I")
_POSE = struct.Struct("<7d")
_STAMP = struct.Struct("<3I")  # Sequence number, s, ns.

_MAX_BYTES = 1024  #: Longest transform that is read (bytes).
#: Largest number of frames that are known, of those kept serialized, and of pairs of names whose
#: serialized form is stored.
_MAX_FRAMES = 1000


class StampedPose(NamedTuple):
    """The pose of a frame at a time."""

    #: parent, child: The frame in which the pose is given, and the frame that it describes.
    parent: str
    child: str
    stamp: int  #: ROS time (ns).
    position: tuple[float, float, float]  #: x, y, z in m.
    #: Quaternion (x, y, z, w), from child to parent coordinates.
    rotation: tuple[float, float, float, float]

    @staticmethod
    def of(transform: TransformStamped) -> "StampedPose":
        """Return the pose of a message; leading slashes of names are dropped."""
        stamp = transform.header.stamp
        t, q = transform.transform.translation, transform.transform.rotation
        return StampedPose(
            transform.header.frame_id.removeprefix("/"),
            transform.child_frame_id.removeprefix("/"),
            stamp.secs * 1_000_000_000 + stamp.nsecs,
            (t.x, t.y, t.z),
            (q.x, q.y, q.z, q.w),
        )

    @property
    def time(self) -> genpy.Time:
        """The stamp as a message has it."""
        return ros_time(self.stamp)

    def message(self) -> TransformStamped:
        """Return the pose as a message."""
        return TransformStamped(
            Header(0, self.time, self.parent),
            self.child,
            Transform(Vector3(*self.position), Quaternion(*self.rotation)),
        )


class RawTransforms(TFMessage):
    """A serialized tf2_msgs/TFMessage, decoded when its transforms are read."""

    __slots__ = ("raw",)
    lossless = True

    def __init__(self) -> None:
        self.raw = _LENGTH.pack(0)  #: The serialized message.

    def deserialize(self, data: bytes) -> "RawTransforms":
        """Keep the serialized message."""
        self.raw = data
        return self

    def serialize(self, buff: BinaryIO) -> None:
        """Write the serialized message."""
        buff.write(self.raw)

    @property
    def transforms(self) -> list[TransformStamped]:
        """All transforms of the message."""
        return TFMessage().deserialize(self.raw).transforms


def entries(raw: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield child frame and serialized form of every transform of a serialized TFMessage.

    A slash before the name of a frame is dropped; transforms of more than 1 kB are left out.
    struct.error or ValueError: the message is shorter than its own length fields.
    """
    (count,) = _LENGTH.unpack_from(raw)
    start = _LENGTH.size
    for _ in range(count):
        names = start + _STAMP.size
        child = names + _LENGTH.size + _LENGTH.unpack_from(raw, names)[0]
        pose = child + _LENGTH.size + _LENGTH.unpack_from(raw, child)[0]
        end = pose + _POSE.size
        if end > len(raw):
            raise ValueError
        if end - start <= _MAX_BYTES:
            yield _names(raw[names:pose])[1], raw[start:end]
        start = end


def decode_pose(entry: bytes) -> StampedPose:
    """Return the pose of a serialized transform, see `entries`."""
    _, seconds, nanoseconds = _STAMP.unpack_from(entry)
    parent, child = _names(entry[_STAMP.size : -_POSE.size])
    numbers = _POSE.unpack_from(entry, len(entry) - _POSE.size)
    moment = seconds * 1_000_000_000 + nanoseconds
    return StampedPose(parent, child, moment, numbers[:3], numbers[3:])


def encode_poses(poses: Iterable[StampedPose]) -> RawTransforms:
    """Return a message with poses."""
    parts = [
        _STAMP.pack(0, *divmod(stamp, 1_000_000_000))
        + _serialized_names(parent, child)
        + _POSE.pack(*position, *rotation)
        for parent, child, stamp, position, rotation in poses
    ]
    return RawTransforms().deserialize(_LENGTH.pack(len(parts)) + b"".join(parts))


@functools.lru_cache(_MAX_FRAMES)
def _names(raw):
    """Return the names of parent and child."""
    child = _LENGTH.size + _LENGTH.unpack_from(raw)[0]
    names = raw[_LENGTH.size : child], raw[child + _LENGTH.size :]
    return tuple(name.decode(errors="replace").removeprefix("/") for name in names)


@functools.lru_cache(_MAX_FRAMES)
def _serialized_names(*names):
    texts = [name.encode() for name in names]
    return b"".join(_LENGTH.pack(len(text)) + text for text in texts)


TransformError = tf2_py.TransformException
"""tf does not know a transform; the text says why.

It is one of tf2's: LookupException (a frame is unknown), ConnectivityException (frames are not
connected), ExtrapolationException (not at that time).
"""

_CACHE = genpy.Duration(10.0)  #: Length of tf2's buffer: tf2's default.
_HISTORY = 100  #: Number of poses of a frame that are kept until tf2 is given them.
_NORM_TOLERANCE = 0.01  #: tf2's tolerance of the squared norm of a quaternion.

#: Largest step back of a stamp that came late by a slower path (ns): the newer pose stays the
#: latest.
_STEP_BACK = 100_000_000

_STEPS_BACK = 3  #: Number of such steps in a row that show that the source's clock was set back.


class _Frame:
    """A moving frame: its latest pose, and those that tf2 was not given yet."""

    __slots__ = ("latest", "recent", "steps_back")

    def __init__(self, pose: StampedPose):
        self.latest = pose
        #: None: tf2 is given each one.
        self.recent: deque[StampedPose] | None = deque(maxlen=_HISTORY)
        self.steps_back = 0


class FrameTree:
    """Frames, their poses and parents. Not thread-safe.

    ``warn(text, key)`` is called for every dropped transform; the key identifies the reason.
    ``ahead`` is how far the stamp of a transform may be ahead of now, s; up to ``clock_delay`` (s)
    beyond it is dropped without a warning.
    """

    def __init__(
        self, warn: Callable[[str, Hashable], None], ahead: float, clock_delay: float = 0.0
    ):
        self.rejected: Counter[str] = Counter()  #: Number of dropped transforms by reason.
        #: Frames that are decoded; and the name that is not allowed.
        self.followed = {""}
        self._warn = warn
        self._ahead = round(ahead * 1e9)
        self._clock_delay = round(clock_delay * 1e9)
        self._frames: dict[str, _Frame] = {}
        self._static: dict[str, StampedPose] = {}
        self._names: set[str] = set()
        self._cleared: set[str] = set()  # Moving frames that were deleted.
        self._unread: dict[str, bytes] = {}
        self._tf2 = tf2_py.BufferCore(_CACHE)

    def clear(self) -> None:
        """Delete all moving frames: time has been reset."""
        self._cleared |= self._frames.keys()
        self._frames.clear()
        self._unread.clear()
        self._tf2.clear()

    def lookup(self, target: str, source: str, stamp: int = 0) -> StampedPose:
        """Return the pose of frame ``source`` in ``target`` at a ROS time (ns), or the latest.

        `TransformError`: a frame is unknown, the two are not connected, or not at that time.
        """
        frame = None if stamp or source in self._static else self._frames.get(source)
        if frame is not None and frame.latest.parent == target:
            return frame.latest
        chains = [set(self._checked_chain(name)) for name in (target, source)]
        for name in (target, source):
            if name not in self._names and target != source:
                text = f"frame {name} is not known; looked up {target} -> {source}"
                raise tf2_py.LookupException(text)
        if chains[0].isdisjoint(chains[1]):
            for name in chains[0] | chains[1]:
                if name in self._cleared - self._frames.keys() - self._static.keys():
                    text = f"no transform of frame {name} has come since time was set back"
                    raise tf2_py.LookupException(text)
            text = f"frames {target} and {source} are not connected"
            raise tf2_py.ConnectivityException(text)
        path = chains[0] ^ chains[1] or {source}
        moving = [self._frames[name] for name in (path & self._frames.keys()) - self._static.keys()]
        # In the past, other frames may have been above these.
        for frame in self._frames.values() if stamp else moving:
            recent, frame.recent = frame.recent, None
            for pose in recent or ():
                self._tf2.set_transform(pose.message(), "tf")
        # tf2's latest common time, to the nanosecond: tf2 in Python has floats (0.1 us).
        stamp = stamp or min((frame.latest.stamp for frame in moving), default=0)
        found = self._tf2.lookup_transform_core(target, source, ros_time(stamp))
        return StampedPose.of(found)._replace(stamp=stamp)

    def read(self, raw: bytes) -> Iterator[StampedPose]:
        """Yield the poses of a serialized message that are followed; keep the others."""
        try:
            for child, entry in entries(raw):
                if child in self.followed:
                    yield decode_pose(entry)
                else:
                    self._unread[child] = entry
                    if len(self._unread) > _MAX_FRAMES:
                        del self._unread[next(iter(self._unread))]
        except (struct.error, ValueError):
            self.rejected["cannot be read"] += 1
            self._warn("ignoring a message on /tf that cannot be read", "cannot be read")

    def take(self, pose: StampedPose, now: int) -> bool:
        """Process a pose at the ROS time ``now`` (ns); return whether it is new, and the latest.

        An invalid one is rejected.
        """
        if not self._is_valid(pose):
            return False
        stamp, frame = pose.stamp, self._frames.get(pose.child)
        if stamp > now + self._ahead:
            # Before the first /clock of a running simulation, now is 0.
            if now:
                warns = stamp > now + self._ahead + self._clock_delay
                self._reject(pose, "is stamped in the future", warns)
            return False
        if frame is not None and stamp < frame.latest.stamp - _STEP_BACK:
            frame.steps_back += 1
            if frame.steps_back < _STEPS_BACK:
                return self._reject(pose, "is stamped in the past")
            # The last pose before the clock was set back would stay the latest until the stamps
            # have caught up.
            self.clear()
            frame = None
        if frame is None:
            frame = self._frames[pose.child] = _Frame(pose)
            self._notice(pose, now)
        elif stamp == frame.latest.stamp:
            return False
        is_latest = stamp >= frame.latest.stamp
        if is_latest:
            if pose.parent != frame.latest.parent:
                self._notice(pose, now)
            frame.latest = pose
            frame.steps_back = 0
        if frame.recent is not None:
            frame.recent.append(pose)
        else:
            self._tf2.set_transform(pose.message(), "tf")
        return is_latest

    def take_static(self, pose: StampedPose, now: int) -> None:
        """Process a static pose; reject an invalid one."""
        if self._is_valid(pose):
            self._static[pose.child] = pose
            self._tf2.set_transform_static(pose.message(), "tf")
            self._notice(pose, now)

    def follow(self, frame: str | None, now: int) -> None:
        """Decode a frame and all above it, from the ROS time ``now`` (ns) on."""
        while frame is not None and frame not in self.followed:
            if len(self.followed) > _MAX_FRAMES:
                return
            if kept := self._unread.pop(frame, None):
                self.take(decode_pose(kept), now)
            # Called afterwards, to avoid a recursion over a long chain.
            self.followed.add(frame)
            frame = self._parent(frame)

    def chain(self, name: str | None) -> Iterator[str]:
        """Yield a frame and all above it, each once."""
        seen = set()
        while name is not None and name not in seen:
            yield name
            seen.add(name)
            name = self._parent(name)

    def _checked_chain(self, name):
        """Return `chain`; refuse a loop, and a frame that has two parents: tf2 does not.

        That happens if two bodies are swapped, or the frames of a static transform are exchanged.
        """
        chain = list(self.chain(name))
        for child in chain:
            moving, static = self._frames.get(child), self._static.get(child)
            if moving and static and moving.latest.parent != static.parent:
                raise tf2_py.ConnectivityException(
                    f"frame {child} has two parents, {moving.latest.parent} on /tf and "
                    f"{static.parent} on /tf_static; expected one: are two bodies swapped?"
                )
        if (first := self._parent(chain[-1])) is not None:
            loop = [*chain[chain.index(first) :], first]
            raise tf2_py.ConnectivityException(
                f"frames are in a loop, each the parent of the one before: {', '.join(loop)}; are "
                "two bodies swapped?"
            )
        return chain

    def _parent(self, name):
        if name in self._frames:
            return self._frames[name].latest.parent
        return self._static[name].parent if name in self._static else None

    def _notice(self, pose, now):
        """Store names that are new."""
        self._names.update((pose.parent, pose.child))
        if pose.child in self.followed:
            self.follow(pose.parent, now)

    def _is_valid(self, pose):
        # tf2 refuses all but the last of these, too, but logs each one; it never deletes a name.
        (a, b, c), (x, y, z, w) = pose.position, pose.rotation
        if not pose.child.strip("/") or not pose.parent.strip("/"):
            return self._reject(pose, "does not name its frames")
        if not math.isfinite(a + b + c + x + y + z + w):
            return self._reject(pose, "is not finite")
        if abs(x * x + y * y + z * z + w * w - 1.0) > _NORM_TOLERANCE:
            return self._reject(pose, "has no unit quaternion")
        names = self._names
        if len(names) >= _MAX_FRAMES and not (pose.parent in names and pose.child in names):
            return self._reject(pose, "is of more frames than the limit")
        return True

    def _reject(self, pose, reason, warns=True):
        self.rejected[reason] += 1
        if warns:
            text = f"ignoring a transform {pose.parent[:50]} -> {pose.child[:50]} that {reason}"
            self._warn(text, (pose.parent, pose.child, reason))
        return False
