"""Poses of tf frames, and their serialization as tf2_msgs/TFMessage.

A pose is a tuple, which takes a fraction of the time of a geometry_msgs/TransformStamped; it is
converted to a message only where one is needed.
"""

import struct
from collections.abc import Iterable, Iterator
from typing import BinaryIO, NamedTuple

import genpy
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from crazyflie_utils.timers import ros_time

_LENGTH = struct.Struct("<I")
_HEADER = struct.Struct("<4I")  # Sequence number, s, ns, length of the parent's name.
_POSE = struct.Struct("<7d")
_STAMP = struct.Struct("<3I")

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


class PoseCodec:
    """Serializes and deserializes poses; stores names of frames, which repeat."""

    def __init__(self) -> None:
        self._read: dict[bytes, tuple[str, str]] = {}
        self._written: dict[tuple[str, str], tuple[bytes, bytes]] = {}

    def decode(self, raw: bytes, start: int, end: int) -> StampedPose:
        """Return the pose between two offsets of a serialized message, see `entries`.

        UnicodeDecodeError: a name is not valid text.
        """
        _, seconds, nanoseconds, length = _HEADER.unpack_from(raw, start)
        names = raw[start + _HEADER.size - _LENGTH.size : end - _POSE.size]
        known = self._read.get(names)
        if known is None:
            known = (
                names[_LENGTH.size : _LENGTH.size + length].decode().removeprefix("/"),
                names[2 * _LENGTH.size + length :].decode().removeprefix("/"),
            )
            _remember(self._read, names, known)
        numbers = _POSE.unpack_from(raw, end - _POSE.size)
        stamp = seconds * 1_000_000_000 + nanoseconds
        return StampedPose(*known, stamp, numbers[:3], numbers[3:])

    def encode(self, poses: Iterable[StampedPose]) -> RawTransforms:
        """Return a message with poses."""
        parts: list[bytes] = []
        for parent, child, stamp, position, rotation in poses:
            known = self._written.get((parent, child))
            if known is None:
                known = (_text(parent), _text(child))
                _remember(self._written, (parent, child), known)
            parts += (
                _STAMP.pack(0, *divmod(stamp, 1_000_000_000)),
                *known,
                _POSE.pack(*position, *rotation),
            )
        # A pose has four parts.
        return RawTransforms().deserialize(_LENGTH.pack(len(parts) // 4) + b"".join(parts))


def entries(raw: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Yield child frame, start and end of every transform of a serialized TFMessage.

    struct.error or ValueError: it is shorter than its own length fields.
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


def _text(name):
    data = name.encode()
    return _LENGTH.pack(len(data)) + data


def _remember(memory, key, value):
    if len(memory) >= _MAX_NAMES:
        memory.clear()
    memory[key] = value
