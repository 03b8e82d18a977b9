"""ROS interface of simulated range sensors: a world and /tf in, ranges out."""

from collections import defaultdict
from functools import partial

import genpy
import numpy as np
from geometry_msgs.msg import TransformStamped
from typing_extensions import override

from crazyflie_ranging.range_sensors import SENSOR_FILE, Ranger, RangeSensor
from crazyflie_ranging.range_topics import RangePublisher
from crazyflie_utils import Node, NodeHandle, Parameters, TransformError, parameter
from crazyflie_utils.parameters.types import BOOLEAN, FRAME, TIME_STEP, TOPIC, Integer
from crazyflie_utils.tf.transforms import MAX_FUTURE_STAMP_SIMULATED
from crazyflie_world.world import World
from crazyflie_world.world_file import WORLD_FILE


class SimulatedRangerParameters(Parameters):
    """Parameters of `SimulatedRangerNode`."""

    world: World = parameter(WORLD_FILE, "what the sensors see, a YAML file")
    sensors: tuple[RangeSensor, ...] = parameter(SENSOR_FILE, "the sensors, a YAML file")
    ranges_topic: str = parameter(
        TOPIC, "below it, each sensor has its topic", "range", name="topics/ranges"
    )
    robot_frame: str = parameter(FRAME, "tf frame of the vehicle", "crazyflie", "frames/robot")
    silence: float = parameter(
        TIME_STEP, "when a pose is older, nothing is published that rests on it", 0.5
    )
    seed: int = parameter(Integer(0, 2**31 - 1), "of the noise", 0)
    enabled: bool = parameter(
        BOOLEAN, "measure; false: silent, as sensors that have failed", True, live=True
    )


class SimulatedRangerNode(Node):
    """Measure distances to what is in a world, where /tf says that the vehicle is."""

    def __init__(self) -> None:
        self._stamps: dict[int, genpy.Time] = {}

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(SimulatedRangerParameters, self._reconfigure)
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
        parameters = self._parameters
        self._publisher = RangePublisher(
            handle, parameters.sensors, parameters.ranges_topic, parameters.robot_frame
        )
        self._lookup = handle.listen_to_transforms()
        for period, (ranger, numbers) in self._groups.items():
            handle.timer(period, partial(self._on_timer, ranger, numbers))

    def _reconfigure(self, parameters):
        self._parameters = parameters

    def _on_timer(self, ranger, numbers):
        if not self._parameters.enabled:
            return
        world = self._parameters.world
        try:
            robot = self._pose(self._parameters.robot_frame)
            centres = {each.name: _position(self._pose(each.name)) for each in world.moving}
        except TransformError as error:
            self._handle.warn(f"no ranges: {error}", throttle=5.0)
            return
        # What rests on a pose is said once.
        if self._stamps.get(numbers[0]) == robot.header.stamp:
            return
        self._stamps[numbers[0]] = robot.header.stamp
        rotation = robot.transform.rotation
        readings = ranger.measure(
            world.placed(centres),
            _position(robot),
            (rotation.x, rotation.y, rotation.z, rotation.w),
        )
        self._publisher.publish(dict(zip(numbers, readings, strict=True)), robot.header.stamp)

    def _pose(self, frame: str) -> TransformStamped:
        pose = self._lookup(self._parameters.world.frame, frame)
        age = (self._handle.stamp() - pose.header.stamp).to_sec()
        # A pose far ahead of now is one from before the clock was set back.
        if not -MAX_FUTURE_STAMP_SIMULATED <= age <= self._parameters.silence:
            raise TransformError(f"the pose of {frame} is {age:.1f} s old")
        return pose


def _position(pose):
    translation = pose.transform.translation
    return translation.x, translation.y, translation.z
