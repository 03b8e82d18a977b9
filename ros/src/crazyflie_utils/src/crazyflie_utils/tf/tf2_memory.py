"""tf2's memory of one process, which is begun only where it is needed."""

from collections import OrderedDict
from typing import Any

import genpy

from crazyflie_utils.tf.poses import StampedPose

_LATEST = genpy.Time()

_CACHE = genpy.Duration(10.0)
"""What tf2 keeps, by its own default."""

_MOST_STAMPS = 10_000
"""Stamps that are remembered for tf2: the last ten seconds of a vehicle at 1 kHz."""


class TransformError(Exception):
    """tf does not know the transform between two frames; the text says why."""


class Tf2Memory:
    """Transforms in tf2, with stamps as they came.

    tf2's Python buffer keeps stamps as floats, to 0.1 us.
    """

    def __init__(self) -> None:
        # Here, since most processes do without.
        import tf2_py

        self._error: type[Exception] = tf2_py.TransformException
        self._buffer: Any = tf2_py.BufferCore(_CACHE)
        self._stamps: OrderedDict[float, int] = OrderedDict()

    def tell(self, pose: StampedPose, is_static: bool = False) -> None:
        """Take a pose."""
        message = pose.message()
        buffer = self._buffer
        (buffer.set_transform_static if is_static else buffer.set_transform)(message, "tf")
        self._stamps[message.header.stamp.to_sec()] = pose.stamp
        if len(self._stamps) > _MOST_STAMPS:
            self._stamps.popitem(last=False)

    def clear(self) -> None:
        """Forget everything that moves."""
        self._stamps.clear()
        self._buffer.clear()

    def lookup(self, target: str, source: str) -> StampedPose:
        """Return the latest pose of frame ``source`` in frame ``target``.

        Raises
        ------
        TransformError
            A frame is unknown, or the two are not connected.
        """
        try:
            found = self._buffer.lookup_transform_core(target, source, _LATEST)
        except self._error as error:
            raise TransformError(str(error)) from None
        pose = StampedPose.of(found)
        return pose._replace(stamp=self._stamps.get(found.header.stamp.to_sec(), pose.stamp))
