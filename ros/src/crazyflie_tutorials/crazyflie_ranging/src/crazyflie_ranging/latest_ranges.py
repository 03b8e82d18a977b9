"""The latest reading of each of several range sensors, while it is alive."""

import math
from functools import partial

from sensor_msgs.msg import Range

from crazyflie_utils import NodeHandle


class LatestRanges:
    """Listens to range sensors.

    Parameters
    ----------
    handle : NodeHandle
    topics : dict
        Name by which a sensor is asked for -> its topic.
    """

    def __init__(self, handle: NodeHandle, topics: dict[str, str]):
        self._handle = handle
        self._readings: dict[str, tuple[float, float]] = {}
        for name, topic in topics.items():
            handle.subscribe(topic, Range, partial(self._take, name))

    def _take(self, name, message):
        if not math.isnan(message.range):
            self._readings[name] = (message.range, self._handle.time())

    def reading(self, name: str, age: float) -> float | None:
        """Return what a sensor said in the last ``age`` seconds, m; None if it was silent."""
        reading, time = self._readings.get(name, (math.nan, -math.inf))
        return reading if self._handle.time() - time <= age else None
