"""The tf frames of a process, and poses as they are sent.

A pose is a tuple, which takes a fraction of the time of a geometry_msgs/TransformStamped; it is
converted to a message only where one is needed.

Transforms of other processes are decoded only for frames that were looked up, and for those above
them in the tree. The last transform of every other frame is kept serialized.

Nearly every lookup is of the latest pose of a frame in its parent, which is answered here. The
others go to tf2, whose buffer is filled with the latest poses at the first of them.
"""

import functools
import math
import struct
from collections import Counter, OrderedDict, deque
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

#: Largest number of frame pairs whose serialized and decoded names are stored.
_MAX_NAMES = 1000


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


def decode_pose(raw: bytes, start: int, end: int) -> StampedPose:
    """Return the pose between two offsets of a serialized message, see `entries`.

    UnicodeDecodeError: a name is not valid text.
    """
    _, seconds, nanoseconds = _STAMP.unpack_from(raw, start)
    parent, child = _names(raw[start + _STAMP.size : end - _POSE.size])
    numbers = _POSE.unpack_from(raw, end - _POSE.size)
    moment = seconds * 1_000_000_000 + nanoseconds
    return StampedPose(parent, child, moment, numbers[:3], numbers[3:])


def encode_poses(poses: Iterable[StampedPose]) -> RawTransforms:
    """Return a message with poses."""
    parts: list[bytes] = []
    for parent, child, stamp, position, rotation in poses:
        parts += (
            _STAMP.pack(0, *divmod(stamp, 1_000_000_000)),
            _serialized_names(parent, child),
            _POSE.pack(*position, *rotation),
        )
    # A pose has three parts.
    return RawTransforms().deserialize(_LENGTH.pack(len(parts) // 3) + b"".join(parts))


@functools.lru_cache(_MAX_NAMES)
def _names(raw):
    """Return the names of parent and child."""
    child = _LENGTH.size + _LENGTH.unpack_from(raw)[0]
    names = raw[_LENGTH.size : child], raw[child + _LENGTH.size :]
    return tuple(name.decode().removeprefix("/") for name in names)


@functools.lru_cache(_MAX_NAMES)
def _serialized_names(*names):
    texts = [name.encode() for name in names]
    return b"".join(_LENGTH.pack(len(text)) + text for text in texts)


def entries(raw: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Yield child frame, start and end of every transform of a serialized TFMessage.

    A slash before the name of a frame is dropped. struct.error or ValueError: the message is
    shorter than its own length fields.
    """
    (count,) = _LENGTH.unpack_from(raw)
    start = _LENGTH.size
    for _ in range(count):
        parent = start + _STAMP.size
        child = parent + _LENGTH.size + _LENGTH.unpack_from(raw, parent)[0]
        pose = child + _LENGTH.size + _LENGTH.unpack_from(raw, child)[0]
        end = pose + _POSE.size
        if end > len(raw):
            raise ValueError
        yield raw[child + _LENGTH.size : pose].removeprefix(b"/"), start, end
        start = end


TransformError = tf2_py.TransformException
"""tf does not know a transform; the text says why.

It is one of tf2's: LookupException (a frame is unknown), ConnectivityException (frames are not
connected), ExtrapolationException (not at that time).
"""

_CACHE = genpy.Duration(10.0)  #: Length of tf2's buffer: tf2's default.
#: Number of stamps stored for tf2: ten seconds of a vehicle at 1 kHz.
_MAX_STAMPS = 10_000
_HISTORY = 100  #: Number of poses of a frame that are kept until tf2 is used.
_NORM_TOLERANCE = 0.01  #: tf2's tolerance of the squared norm of a quaternion.

#: Largest step back of a stamp that came late by a slower path (ns): the newer pose stays the
#: latest.
_STEP_BACK = 100_000_000

_STEPS_BACK = 3  #: Number of such steps in a row that show that the source's clock was set back.
_MAX_FRAMES = 1000  #: Largest number of known frames, and of frames kept serialized.
_MAX_BYTES = 1024  #: Largest transform that is kept serialized (bytes).
_ONE = b"\x01\0\0\0"  #: The length of a message with one transform.


class _Frame:
    """A moving frame: its poses and parent."""

    __slots__ = ("latest", "recent", "steps_back")

    def __init__(self, pose: StampedPose):
        self.latest = pose
        self.recent: deque[StampedPose] = deque(maxlen=_HISTORY)
        self.steps_back = 0


class FrameTree:
    """Frames, their poses and parents. Not thread-safe.

    ``warn(text, key)`` is called for every dropped transform; the key identifies the reason.
    ``ahead`` is how far the stamp of a transform may be ahead of now, s; up to ``clock_delay`` (s)
    beyond it is dropped without a warning. ``on_new(pose)`` is called with every pose that is the
    latest of its frame.
    """

    def __init__(
        self,
        warn: Callable[[str, Hashable], None],
        ahead: float,
        on_new: Callable[[StampedPose], None],
        clock_delay: float = 0.0,
    ):
        self.rejected: Counter[str] = Counter()  #: Number of dropped transforms by reason.
        self.followed: set[str] = set()  #: Frames that are decoded.
        self._warn = warn
        self._ahead = round(ahead * 1e9)
        self._clock_delay = round(clock_delay * 1e9)
        self._on_new = on_new
        self._frames: dict[str, _Frame] = {}
        self._static: dict[str, StampedPose] = {}
        self._names: set[str] = set()
        # Serialized names of the frames that are followed; and the one that is not allowed.
        self._wanted = {b""}
        self._unread: dict[bytes, bytes] = {}
        self._tf2: tf2_py.BufferCore | None = None
        # tf2 in Python has floats, which resolve 0.1 us: the stamps by these floats.
        self._stamps: OrderedDict[float, int] = OrderedDict()

    def clear(self) -> None:
        """Delete all moving frames: time has been reset."""
        self._frames.clear()
        self._unread.clear()
        self._stamps.clear()
        if self._tf2 is not None:
            self._tf2.clear()

    def latest(self, target: str, source: str) -> StampedPose | None:
        """Return the latest pose of a moving frame, if ``target`` is right above it."""
        frame = self._frames.get(source)
        if frame is not None and frame.latest.parent == target and source not in self._static:
            return frame.latest
        return None

    def lookup(self, target: str, source: str, stamp: int = 0) -> StampedPose:
        """Return the pose of frame ``source`` in ``target`` at a ROS time (ns), or the latest.

        `TransformError`: a frame is unknown, the two are not connected, or not at that time.
        """
        for name in (target, source):
            self._check_parents(name)
        for name in (target, source):
            # tf2 is not needed as long as a frame is unknown.
            if name not in self._names and target != source:
                text = f"frame {name} is not known; looked up {target} -> {source}"
                raise tf2_py.LookupException(text)
        if not set(self.chain(target)) & set(self.chain(source)):
            text = f"frames {target} and {source} are not connected"
            raise tf2_py.ConnectivityException(text)
        if self._tf2 is None:
            self._tf2 = tf2_py.BufferCore(_CACHE)
            for pose in self._static.values():
                self._add_to_tf2(pose, is_static=True)
            for frame in self._frames.values():
                for pose in frame.recent:
                    self._add_to_tf2(pose)
                frame.recent.clear()
        found = self._tf2.lookup_transform_core(target, source, ros_time(stamp))
        pose = StampedPose.of(found)
        known = self._stamps.get(found.header.stamp.to_sec(), pose.stamp)
        return pose._replace(stamp=stamp or known)

    def read(self, raw: bytes, now: int) -> None:
        """Process a serialized message at the ROS time ``now`` (ns)."""
        try:
            for child, start, end in entries(raw):
                if child in self._wanted:
                    self.take(decode_pose(raw, start, end), now)
                elif end - start <= _MAX_BYTES:
                    self._unread[child] = raw[start:end]
                    if len(self._unread) > _MAX_FRAMES:
                        del self._unread[next(iter(self._unread))]
        except (struct.error, ValueError):
            self.rejected["cannot be read"] += 1
            self._warn("ignoring a message on /tf that cannot be read", "cannot be read")

    def take(self, pose: StampedPose, now: int) -> None:
        """Process a pose at the ROS time ``now`` (ns); reject an invalid one."""
        if not self._is_valid(pose) or not self._is_timely(pose, now):
            return
        frame = self._frames.get(pose.child)
        if frame is None:
            frame = self._frames[pose.child] = _Frame(pose)
            self._notice(pose, now)
        if pose.stamp >= frame.latest.stamp:
            if pose.parent != frame.latest.parent:
                self._notice(pose, now)
            frame.latest = pose
            frame.steps_back = 0
            self._on_new(pose)
        if self._tf2 is None:
            frame.recent.append(pose)
        else:
            self._add_to_tf2(pose)

    def take_static(self, pose: StampedPose, now: int) -> None:
        """Process a static pose; reject an invalid one."""
        if not self._is_valid(pose):
            return
        self._static[pose.child] = pose
        self._add_to_tf2(pose, is_static=True)
        self._notice(pose, now)

    def follow(self, frame: str | None, now: int) -> None:
        """Decode a frame and all above it, from the ROS time ``now`` (ns) on."""
        while frame is not None and frame not in self.followed:
            if len(self.followed) >= _MAX_FRAMES:
                return
            name = frame.encode()
            self._wanted.add(name)
            if kept := self._unread.pop(name, None):
                self.read(_ONE + kept, now)
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

    def _check_parents(self, name):
        """Refuse a frame in a loop, or with an ancestor that has two parents: tf2 does not.

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

    def _parent(self, name):
        if name in self._frames:
            return self._frames[name].latest.parent
        return self._static[name].parent if name in self._static else None

    def _add_to_tf2(self, pose, is_static=False):
        tf2 = self._tf2
        if tf2 is None:
            return
        message = pose.message()
        (tf2.set_transform_static if is_static else tf2.set_transform)(message, "tf")
        self._stamps[message.header.stamp.to_sec()] = pose.stamp
        if len(self._stamps) > _MAX_STAMPS:
            self._stamps.popitem(last=False)

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

    def _is_timely(self, pose, now):
        """Return whether a pose is new; delete the moving frames if its source's clock was set."""
        if pose.stamp > now + self._ahead:
            # Before the first /clock of a running simulation, now is 0.
            if not now:
                return False
            warns = pose.stamp > now + self._ahead + self._clock_delay
            return self._reject(pose, "is stamped in the future", warns)
        frame = self._frames.get(pose.child)
        if frame is None:
            return True
        if pose.stamp < frame.latest.stamp - _STEP_BACK:
            frame.steps_back += 1
            if frame.steps_back < _STEPS_BACK:
                return self._reject(pose, "is stamped in the past")
            # The last pose before the clock was set back would stay the latest until the stamps
            # have caught up.
            self.clear()
        return pose.stamp != frame.latest.stamp

    def _reject(self, pose, reason, warns=True):
        self.rejected[reason] += 1
        if not warns:
            return False
        text = f"ignoring a transform {pose.parent[:50]} -> {pose.child[:50]} that {reason}"
        self._warn(text, (pose.parent, pose.child, reason))
        return False
