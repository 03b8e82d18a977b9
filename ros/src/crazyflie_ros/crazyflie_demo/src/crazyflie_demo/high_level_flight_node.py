"""ROS interface of a test flight by high-level commands."""

from geometry_msgs.msg import Point

from crazyflie_demo.flight_plan_node import FlightPlanNode, Step, seconds
from crazyflie_driver.srv import GoTo, GoToRequest
from crazyflie_utils.parameter_types import METRES


class HighLevelFlightNode(FlightPlanNode):
    """Take off, go ahead and back again, land."""

    def __init__(self):
        super().__init__()
        self._distance = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        super().load_parameters(handle)
        self._distance = handle.param("distance", METRES, 0.5)

    def manoeuvres(self) -> list[Step]:
        """See `FlightPlanNode.manoeuvres`."""
        return [self._go(self._distance), self._go(-self._distance)]

    def _go(self, x):
        request = GoToRequest(
            relative=True, goal=Point(x, 0.0, 0.0), duration=seconds(self._duration)
        )
        return Step("go_to", GoTo, request, self._duration)
