"""ROS interface of a flight by positions."""

import numpy as np
from std_msgs.msg import Empty
from typing_extensions import override

from crazyflie_demo.parameters import SetpointParameters
from crazyflie_demo.stream_node import StreamNode
from crazyflie_driver.msg import Position
from crazyflie_utils import NodeHandle, parameter
from crazyflie_utils.parameters.types import METRES, Number


class PositionFlightParameters(SetpointParameters):
    """Parameters of `PositionFlightNode`."""

    x: float = parameter(METRES, "start of the flight", 0.0)
    y: float = parameter(METRES, "start of the flight", 0.0)
    height: float = parameter(Number("m", above=0.0, maximum=3.0), "how high it flies", 0.4)
    distance: float = parameter(METRES, "how far ahead and to the left it goes", 0.2)
    speed: float = parameter(Number("m/s", above=0.0, maximum=1.0), "of the whole flight", 0.2)


class PositionFlightNode(StreamNode):
    """Climb, go ahead and to the left, back, and land; then stop the motors."""

    topic, message_type = "cmd_position", Position

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        p = handle.load(PositionFlightParameters)
        side = [p.distance, p.distance, p.height]
        above = [0.0, 0.0, p.height]
        # Each place twice, to stay there for a second.
        places = np.repeat([[0.0, 0.0, 0.0], above, side, above, [0.0, 0.0, 0.0]], 2, axis=0)
        durations = np.linalg.norm(np.diff(places, axis=0), axis=1) / p.speed
        durations[durations == 0.0] = 1.0
        self._times = np.concatenate([[0.0], np.cumsum(durations)])
        self._places = places + [p.x, p.y, 0.0]
        self.duration, self.rate = float(self._times[-1]), p.rate

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._stop = handle.publisher("cmd_stop", Empty)
        super().register_callbacks(handle)

    @override
    def setpoint(self, time: float) -> Position:
        x, y, z = (float(np.interp(time, self._times, axis)) for axis in self._places.T)
        message = Position(x=x, y=y, z=z, yaw=0.0)
        message.header.frame_id = "world"
        return message

    @override
    def finish(self) -> None:
        self._stop.publish(Empty())
