"""The node: reads a sensor for 2 s, then says PASS or FAIL; needs `sensor_check.faults`."""

from sensor_msgs.msg import Range
from typing_extensions import override

from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC, Number
from follow_box.sensor_check import Reading, faults

DURATION = 2.0


class CheckParameters(Parameters):
    """Parameters of `CheckNode`."""

    range_topic: str = parameter(TOPIC, "the sensor", "range/front", name="topics/range")
    rate: float = parameter(Number("Hz", above=0.0), "that it should have", 20.0)


class CheckNode(Node):
    """Log "PASS" or "FAIL: why" again and again, every 2 s."""

    def __init__(self) -> None:
        self._readings: list[Reading] = []
        self._limits = (0.0, 0.0)
        self._since = 0.0

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(CheckParameters)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._since = handle.time()
        handle.subscribe(self._parameters.range_topic, Range, self._on_range)
        handle.timer(DURATION, self._on_timer)

    def _on_range(self, message):
        self._readings.append(Reading(self._handle.time(), message.range))
        self._limits = (message.min_range, message.max_range)

    def _on_timer(self):
        now = self._handle.time()
        duration, self._since = now - self._since, now
        readings, self._readings = self._readings, []
        # Simulated time jumps from 0 to now at its first message: nothing was silent in that time.
        if abs(duration - DURATION) > 0.1 * DURATION:
            return
        topic = self._handle.resolve(self._parameters.range_topic)
        found = faults(readings, *self._limits, self._parameters.rate)
        if found:
            self._handle.error(f"FAIL: {topic}: {', '.join(found)}")
        else:
            self._handle.info(f"PASS: {topic}")
