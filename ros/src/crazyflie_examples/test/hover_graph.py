"""sw_hover.launch without a master, in simulated time."""

from pathlib import Path

from rospkg import RosPack
from std_srvs.srv import EmptyRequest

from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import FakeGraph
from crazyflie_utils.testing.launch_files import composed_nodes, expand

LAUNCH = Path(RosPack().get_path("crazyflie_examples")) / "launch/sw_hover.launch"


class HoverGraph:
    """The software example with some of its arguments, and its course."""

    def __init__(self, mass_error=0.0, **arguments):
        _, parameters = expand(LAUNCH, composed=True, rviz=False, **arguments)
        if mass_error:
            parameters["/simulator/mass_error"] = mass_error
        self.graph = FakeGraph(parameters)
        self.course = []  #: Positions of the vehicle (m).
        self.graph.listen("/tf", self._on_tf)
        for name, node in NODE_CLASSES(composed_nodes(parameters)).items():
            self.graph.start(f"/{name}", node())
        self.graph.advance(2.0)

    def _on_tf(self, message):
        for each in message.transforms:
            p = each.transform.translation
            self.course.append((p.x, p.y, p.z))

    def take_off(self, duration=15.0):
        """Take off, and advance the time (s)."""
        takeoff = self.graph.call("/takeoff", EmptyRequest())
        self.graph.advance(duration)
        assert takeoff.exception(0) is None

    def refer(self, x, y, z, caller=""):
        """Send a reference once."""
        message = PositionVelocityStateStamped(state=PositionVelocityState(x, y, z, 0.0, 0.0, 0.0))
        message.header.stamp = self.graph.stamp()
        self.graph.publish("/ref", message, caller)
