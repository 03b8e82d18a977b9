"""ROS interface of a test flight by high-level commands."""

from geometry_msgs.msg import Point
from typing_extensions import override

from crazyflie_demo.flight_plan_node import FlightPlanNode, FlightPlanParameters, Step, seconds
from crazyflie_driver.srv import GoTo, GoToRequest
from crazyflie_utils import NodeHandle, parameter
from crazyflie_utils.parameters.types import METRES


class HighLevelFlightParameters(FlightPlanParameters):
    """Parameters of `HighLevelFlightNode`."""

    distance: float = parameter(METRES, "how far ahead the vehicle goes", 0.5)


class HighLevelFlightNode(FlightPlanNode):
    """Take off, go ahead and back again, land."""

    _parameters: HighLevelFlightParameters

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(HighLevelFlightParameters)

    @override
    def manoeuvres(self) -> list[Step]:
        return [self._go(self._parameters.distance), self._go(-self._parameters.distance)]

    def _go(self, x):
        duration = self._parameters.duration
        request = GoToRequest(relative=True, goal=Point(x, 0.0, 0.0), duration=seconds(duration))
        return Step("go_to", GoTo, request, duration)
