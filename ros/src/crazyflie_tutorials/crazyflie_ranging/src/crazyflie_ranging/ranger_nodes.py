"""ROS interfaces of range sensors: those of a Multi-ranger deck, and simulated ones."""

import math
from collections import defaultdict
from collections.abc import Iterator
from functools import partial

import genpy
import numpy as np
from sensor_msgs.msg import Range
from typing_extensions import override

from crazyflie_driver.msg import GenericLogData
from crazyflie_ranging.range_sensors import SENSOR_FILE, ULTRASONIC, Ranger, RangeSensor
from crazyflie_utils import Node, NodeHandle, Parameters, TransformError, parameter, topic
from crazyflie_utils.parameters.types import BOOLEAN, FRAME, TEXT, TIME_STEP, Integer, ListOf
from crazyflie_utils.tf.frame_tree import StampedPose
from crazyflie_utils.tf.transforms import MAX_FUTURE_STAMP_SIMULATED
from crazyflie_utils.vectors import stamped
from crazyflie_world.world import World
from crazyflie_world.world_file import WORLD_FILE


class RangerParameters(Parameters):
    """Parameters that both nodes have."""

    sensors: tuple[RangeSensor, ...] = parameter(SENSOR_FILE, "the sensors, a YAML file")
    ranges_topic: str = topic("ranges", "namespace of the sensors' topics", "range")
    robot_frame: str = parameter(FRAME, "tf frame of the vehicle", "crazyflie", "frames/robot")


class RangePublisher:
    """Publishes the readings of sensors, and their frames on the vehicle's."""

    def __init__(self, handle: NodeHandle, parameters: RangerParameters):
        topic, self._frame = parameters.ranges_topic, parameters.robot_frame
        self._sensors = parameters.sensors
        self._publishers = [
            handle.publisher(f"{topic}/{each.name}", Range) for each in self._sensors
        ]
        self._broadcast = handle.broadcast_transforms()

    def publish(self, readings: dict[int, float], stamp: genpy.Time) -> None:
        """Publish the readings (m) of some sensors, by their number, and the sensors' frames."""
        for index, reading in readings.items():
            sensor = self._sensors[index]
            message = stamped(
                Range,
                stamp,
                sensor.frame_id,
                radiation_type=Range.ULTRASOUND if sensor.type == ULTRASONIC else Range.INFRARED,
                field_of_view=sensor.spread_angle,
                min_range=sensor.min_range,
                max_range=sensor.max_range,
                range=reading,
            )
            self._publishers[index].publish(message)
        sensors, now = [self._sensors[index] for index in readings], stamp.to_nsec()
        poses = [StampedPose(self._frame, s.frame_id, now, s.position, s.attitude) for s in sensors]
        self._broadcast([pose.message() for pose in poses])


_MILLIMETRE = 0.001


class DeckRangerParameters(RangerParameters):
    """Parameters of `DeckRangerNode`."""

    variables: tuple[str, ...] = parameter(
        ListOf(TEXT),
        "variables of the log block in their order, as in the driver's parameter",
        name="genericLogTopic_ranges_Variables",
    )
    log_topic: str = topic("log", "rate of the log block", "crazyflie/ranges")

    @override
    def complaints(self) -> Iterator[str]:
        for sensor in self.sensors:
            if sensor.log_variable not in self.variables:
                yield (
                    f"the sensor {sensor.name} reads {sensor.log_variable}; expected one of "
                    f"genericLogTopic_ranges_Variables, {', '.join(self.variables)}"
                )


class DeckRangerNode(Node[DeckRangerParameters]):
    """Publish the measurements of the sensors on a vehicle's deck."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        place = self._parameters.variables.index
        self._places = [place(sensor.log_variable) for sensor in self._parameters.sensors]
        self._publisher = RangePublisher(handle, self._parameters)
        handle.subscribe(self._parameters.log_topic, GenericLogData, self._on_log)

    def _on_log(self, message):
        parameters = self._parameters
        topic = self._handle.resolve(parameters.log_topic)
        fault = "" if all(map(math.isfinite, message.values)) else "its values are not finite"
        if len(message.values) != len(parameters.variables):
            fault = f"it has {len(message.values)} values; expected {len(parameters.variables)}"
        if fault:
            self._handle.warn(f"ignoring a message on {topic}: {fault}", throttle=5.0)
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


class SimulatedRangerParameters(RangerParameters):
    """Parameters of `SimulatedRangerNode`."""

    world: World = parameter(WORLD_FILE, "world that the sensors see, a YAML file")
    silence: float = parameter(
        TIME_STEP, "largest age of a pose; with an older one, no reading is published", 0.5
    )
    seed: int = parameter(Integer(0, 2**31 - 1), "seed of the noise", 0)
    enabled: bool = parameter(
        BOOLEAN, "whether sensors measure; false: silent, like failed sensors", True, live=True
    )


class SimulatedRangerNode(Node[SimulatedRangerParameters]):
    """Measure distances to the objects of a world from the vehicle's pose on /tf."""

    def __init__(self) -> None:
        self._stamps: dict[int, int] = {}

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        super().load_parameters(handle)
        numbers = defaultdict(list)
        for number, sensor in enumerate(self._parameters.sensors):
            numbers[sensor.desired_frequency].append(number)
        random = np.random.default_rng(self._parameters.seed)
        self._groups = {
            1.0 / frequency: (
                Ranger([self._parameters.sensors[number] for number in group], random),
                group,
            )
            for frequency, group in numbers.items()
        }

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = RangePublisher(handle, self._parameters)
        self._lookup = handle.listen_to_poses()
        for period, (ranger, numbers) in self._groups.items():
            handle.timer(period, partial(self._on_timer, ranger, numbers))

    def _on_timer(self, ranger, numbers):
        if not self._parameters.enabled:
            return
        world = self._parameters.world
        try:
            robot = self._pose(self._parameters.robot_frame)
            centres = {each.name: self._pose(each.name).position for each in world.moving}
        except TransformError as error:
            self._handle.warn(f"no ranges: {error}", throttle=5.0)
            return
        # A missing pose is logged once.
        if self._stamps.get(numbers[0]) == robot.stamp:
            return
        self._stamps[numbers[0]] = robot.stamp
        readings = ranger.measure(world.placed(centres), robot.position, robot.rotation)
        self._publisher.publish(dict(zip(numbers, readings, strict=True)), robot.time)

    def _pose(self, frame: str) -> StampedPose:
        pose = self._lookup(self._parameters.world.frame, frame)
        age = (self._handle.stamp() - pose.time).to_sec()
        # A pose far ahead of now is one from before the clock was set back.
        if not -MAX_FUTURE_STAMP_SIMULATED <= age <= self._parameters.silence:
            raise TransformError(f"the pose of {frame} is {age:.1f} s old")
        return pose
