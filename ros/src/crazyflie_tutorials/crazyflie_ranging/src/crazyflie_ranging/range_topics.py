"""Topics and frames of range sensors: publishing measurements, and the latest of each."""

import math
from collections.abc import Sequence
from functools import partial

import genpy
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from sensor_msgs.msg import Range

from crazyflie_ranging.range_sensors import ULTRASONIC, RangeSensor
from crazyflie_utils import NodeHandle


class RangePublisher:
    """Publishes the readings of sensors, each below ``topic``, and their frames on the vehicle's."""

    def __init__(self, handle: NodeHandle, sensors: Sequence[RangeSensor], topic: str, frame: str):
        self._publishers = [handle.publisher(f"{topic}/{each.name}", Range) for each in sensors]
        self._broadcast = handle.broadcast_transforms()
        self._sensors = sensors
        self._frame = frame

    def publish(self, readings: dict[int, float], stamp: genpy.Time) -> None:
        """Publish the readings (m) of some sensors, by their number, and the sensors' frames."""
        for index, reading in readings.items():
            sensor = self._sensors[index]
            message = Range(
                radiation_type=Range.ULTRASOUND if sensor.type == ULTRASONIC else Range.INFRARED,
                field_of_view=sensor.spread_angle,
                min_range=sensor.min_range,
                max_range=sensor.max_range,
                range=reading,
            )
            message.header.stamp = stamp
            message.header.frame_id = sensor.frame_id
            self._publishers[index].publish(message)
        self._broadcast([self._transform(self._sensors[index], stamp) for index in readings])

    def _transform(self, sensor, stamp):
        transform = TransformStamped(child_frame_id=sensor.frame_id)
        transform.header.stamp = stamp
        transform.header.frame_id = self._frame
        transform.transform.translation = Vector3(*sensor.position)
        transform.transform.rotation = Quaternion(*sensor.attitude)
        return transform


class LatestRanges:
    """The latest readings of range sensors; ``topics`` has their topics by name."""

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
