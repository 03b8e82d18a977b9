"""ROS interface of the sensors on a Multi-ranger deck: the driver's log blocks in, ranges out."""

import math
from collections.abc import Iterator

from typing_extensions import override

from crazyflie_driver.msg import GenericLogData
from crazyflie_ranging.range_sensors import SENSOR_FILE, RangeSensor
from crazyflie_ranging.range_topics import RangePublisher
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import FRAME, TEXT, TOPIC, ListOf

_MILLIMETRE = 0.001


class DeckRangerParameters(Parameters):
    """Parameters of `DeckRangerNode`."""

    sensors: tuple[RangeSensor, ...] = parameter(SENSOR_FILE, "the sensors, a YAML file")
    variables: tuple[str, ...] = parameter(
        ListOf(TEXT),
        "of the log block in their order, as in the driver's parameter",
        name="genericLogTopic_ranges_Variables",
    )
    log_topic: str = parameter(TOPIC, "of the log block", "crazyflie/ranges", "topics/log")
    ranges_topic: str = parameter(
        TOPIC, "below it, each sensor has its topic", "range", name="topics/ranges"
    )
    robot_frame: str = parameter(FRAME, "tf frame of the vehicle", "crazyflie", "frames/robot")

    @override
    def complaints(self) -> Iterator[str]:
        for sensor in self.sensors:
            if sensor.log_variable not in self.variables:
                yield (
                    f"the sensor {sensor.name} reads {sensor.log_variable}; expected one of "
                    f"genericLogTopic_ranges_Variables, {', '.join(self.variables)}"
                )


class DeckRangerNode(Node):
    """Publish what the sensors on a vehicle's deck measure."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(DeckRangerParameters)
        places = {name: place for place, name in enumerate(self._parameters.variables)}
        self._places = [places[sensor.log_variable] for sensor in self._parameters.sensors]

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = RangePublisher(
            handle, parameters.sensors, parameters.ranges_topic, parameters.robot_frame
        )
        handle.subscribe(parameters.log_topic, GenericLogData, self._on_log)

    def _on_log(self, message):
        parameters = self._parameters
        topic = self._handle.resolve(parameters.log_topic)
        if len(message.values) != len(parameters.variables):
            text = f"it has {len(message.values)} values; expected {len(parameters.variables)}"
            self._handle.warn(f"ignoring a message on {topic}: {text}", throttle=5.0)
            return
        if not all(map(math.isfinite, message.values)):
            text = "its values are not finite"
            self._handle.warn(f"ignoring a message on {topic}: {text}", throttle=5.0)
            return
        readings = {}
        for number, (sensor, place) in enumerate(
            zip(parameters.sensors, self._places, strict=True)
        ):
            # The firmware's variable is 0 until its sensor has measured, and without a sensor.
            if message.values[place] > 0.0:
                readings[number] = sensor.reading(_MILLIMETRE * message.values[place])
            else:
                text = f"{sensor.log_variable} on {topic} is 0: is there a deck?"
                self._handle.warn(text, throttle=5.0)
        if readings:
            self._publisher.publish(readings, message.header.stamp)
