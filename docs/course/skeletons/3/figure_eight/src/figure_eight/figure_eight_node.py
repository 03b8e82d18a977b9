"""The node: a subscriber that says when to begin, a timer, two publishers."""

from geometry_msgs.msg import Twist
from std_msgs.msg import UInt32
from typing_extensions import override

from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import TIME_STEP, Number
from figure_eight.figure_eight import FigureEight


class FigureEightParameters(Parameters):
    """Parameters of `FigureEightNode`."""

    time_step: float = parameter(TIME_STEP, "between two velocities", 0.1)
    radius: float = parameter(Number("m", above=0.0), "of the two circles", 0.5)
    speed: float = parameter(Number("m/s", above=0.0), "along them", 0.3)


class FigureEightNode(Node):
    """Publish velocities while the vehicle flies, and how many circles are complete."""

    def __init__(self) -> None:
        self._beginning: float | None = None

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(FigureEightParameters)
        self._eight = FigureEight(self._parameters.radius, self._parameters.speed)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._velocities = handle.publisher("cmd_vel", Twist)
        self._circles = handle.publisher("~circles", UInt32, latch=True)
        # Step 3: subscribe to in_flight_flight_status (FlightStatus); self._beginning is the time
        # handle.time() at which the vehicle began to fly, None when it does not.
        # Step 4: a timer that calls every time_step publishes the velocity and the circles.
