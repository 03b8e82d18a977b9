"""tf2's buffer of one process, which is filled only where it is needed."""

from collections import OrderedDict

import genpy
import tf2_py

from crazyflie_utils.clock import ros_time
from crazyflie_utils.tf.poses import StampedPose

TransformError = tf2_py.TransformException
"""tf does not know a transform; the text says why.

It is one of tf2's: LookupException (a frame is unknown), ConnectivityException (frames are not
connected), ExtrapolationException (not at that time).
"""

_LATEST = genpy.Time()

_CACHE = genpy.Duration(10.0)  #: What tf2 keeps, by its own default.
#: Stamps that are remembered for tf2: the last ten seconds of a vehicle at 1 kHz.
_MAX_STAMPS = 10_000


class Buffer:
    """Transforms in tf2, with stamps as they came: tf2 in Python has them as floats, to 0.1 us."""

    def __init__(self) -> None:
        self._buffer = tf2_py.BufferCore(_CACHE)
        self._stamps: OrderedDict[float, int] = OrderedDict()

    def add(self, pose: StampedPose, is_static: bool = False) -> None:
        """Add a pose."""
        message = pose.message()
        buffer = self._buffer
        (buffer.set_transform_static if is_static else buffer.set_transform)(message, "tf")
        self._stamps[message.header.stamp.to_sec()] = pose.stamp
        if len(self._stamps) > _MAX_STAMPS:
            self._stamps.popitem(last=False)

    def clear(self) -> None:
        """Forget everything that moves."""
        self._stamps.clear()
        self._buffer.clear()

    def lookup(self, target: str, source: str, stamp: int = 0) -> StampedPose:
        """Return the pose of frame ``source`` in ``target`` at a ROS time (ns); 0: the latest."""
        moment = ros_time(stamp) if stamp else _LATEST
        found = self._buffer.lookup_transform_core(target, source, moment)
        pose = StampedPose.of(found)
        known = self._stamps.get(found.header.stamp.to_sec(), pose.stamp)
        return pose._replace(stamp=stamp or known)
