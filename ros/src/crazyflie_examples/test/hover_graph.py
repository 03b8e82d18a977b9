"""sw_hover.launch without a master, in simulated time."""

from pathlib import Path

from rospkg import RosPack
from std_srvs.srv import EmptyRequest

from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import FakeGraph
from crazyflie_utils.testing.launch_files import composed_nodes, expand

PACKAGES = RosPack()
LAUNCH = Path(PACKAGES.get_path("crazyflie_examples")) / "launch/sw_hover.launch"
#: Arguments with the gains of hardware.
HARDWARE = {
    **{"dynamics": "quadrotor", "estimator_filter": "kalman"},
    "K_file": str(Path(PACKAGES.get_path("crazyflie_lqr")) / "references/K_manual.txt"),
    **{"integrator_k_x": -0.05, "integrator_k_y": 0.05, "integrator_k_z": -0.5},
    **{"integrator_thresh_x": 1.0, "integrator_thresh_y": 1.0, "integrator_thresh_z": 6.0},
}


class HoverGraph:
    """The software example with some of its arguments, and its course.

    ``without`` are parameters that are not set.
    """

    def __init__(self, mass_error=0.0, without=(), **arguments):
        _, parameters = expand(LAUNCH, composed=True, rviz=False, **arguments)
        for name in without:
            del parameters[name]
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
