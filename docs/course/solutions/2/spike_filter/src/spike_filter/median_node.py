"""The node: the ROS interface of the algorithm."""

import math

from std_msgs.msg import Float64
from std_srvs.srv import Empty, EmptyResponse
from typing_extensions import override

from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC, Integer
from spike_filter.median import Median


class MedianParameters(Parameters):
    """Parameters of `MedianNode`."""

    window: int = parameter(Integer(1, 1001), "of how many numbers the median is taken", 5)
    input_topic: str = parameter(TOPIC, "where numbers come from", name="topics/input")
    output_topic: str = parameter(TOPIC, "where medians go", name="topics/output")


class MedianNode(Node):
    """Publish the median for every number; the service ~reset forgets them."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(MedianParameters)
        self._algorithm = Median(self._parameters.window)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.output_topic, Float64)
        handle.advertise_service("~reset", Empty, self._on_reset)
        handle.subscribe(parameters.input_topic, Float64, self._on_number)

    def _on_reset(self, _):
        self._algorithm.reset()
        return EmptyResponse()

    def _on_number(self, message):
        if not math.isfinite(message.data):
            topic = self._handle.resolve(self._parameters.input_topic)
            self._handle.warn(f"ignoring {message.data} on {topic}", throttle=1.0)
            return
        self._publisher.publish(Float64(self._algorithm.add(message.data)))
