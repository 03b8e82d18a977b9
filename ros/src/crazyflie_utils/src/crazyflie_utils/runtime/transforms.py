"""tf for a process: one tf2 buffer and one broadcaster, however many nodes."""

import threading
from collections.abc import Callable
from typing import Any

import genpy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from crazyflie_utils.runtime.topics import Publisher, Topics
from crazyflie_utils.vectors import is_finite

_LATEST = genpy.Time()

_MOST_STAMPS = 10_000
"""Stamps that are remembered: the last ten seconds of a vehicle at 1 kHz."""

_NORM_TOLERANCE = 0.01
"""How far tf2 lets the squared norm of a quaternion be from 1."""


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
        Called with a text about every transform that is dropped.
    """

    def __init__(self, topics: Topics, warn: Callable[[str], None]):
        self._topics = topics
        self._warn = warn
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
        self._store(message, self._buffer.set_transform)

    def _on_static(self, message):
        self._store(message, self._buffer.set_transform_static)

    def _store(self, message, store):
        for transform in message.transforms:
            reason = _why_invalid(transform.transform)
            if reason is None:
                store(transform, "tf")
                self._remember(transform.header.stamp)
            else:
                self._warn(
                    f"ignoring a transform {transform.header.frame_id} -> "
                    f"{transform.child_frame_id} that {reason}"
                )

    def _remember(self, stamp):
        # Each broadcaster outside has its own thread here.
        with self._lock:
            self._stamps[stamp.to_sec()] = stamp
            if len(self._stamps) > _MOST_STAMPS:
                del self._stamps[next(iter(self._stamps))]


def _why_invalid(transform):
    # tf2 refuses both, too, but says so without a throttle.
    if not is_finite(transform):
        return "is not finite"
    q = transform.rotation
    if abs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0) > _NORM_TOLERANCE:
        return "has no unit quaternion"
    return None
