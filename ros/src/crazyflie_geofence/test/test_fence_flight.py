"""Whole flights in a fence whose box changes: every node in a fake process of its own."""

import math
from pathlib import Path

import pytest
import rospkg
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.srv import ReconfigureRequest
from sensor_msgs.msg import Joy
from std_srvs.srv import EmptyRequest

from crazyflie_control_merger.merger_nodes import RegularControlMergerNode
from crazyflie_msgs.msg import PositionVelocityStateStamped
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.testing import FakeGraph
from crazyflie_utils.testing.launch_files import composed_nodes, expand

EXAMPLES, TELEOP = (
    Path(rospkg.RosPack().get_path(name)) / "launch"
    for name in ("crazyflie_examples", "crazyflie_teleop")
)
FILTER, FENCE = "/takeoff_control_filter", "/geofence"


class FencedFlight:
    """sw_geofence.launch, or another, without a master."""

    def __init__(self, file=EXAMPLES / "sw_geofence.launch", classes=None, **arguments):
        _, parameters = expand(file, composed=True, rviz=False, simulator_dt=0.005, **arguments)
        self.classes = {**NODE_CLASSES(composed_nodes(parameters)), **(classes or {})}
        self.graph = FakeGraph(parameters)
        self.status = ""
        self.position = (0.0, 0.0, 0.0)
        self.last = None
        self.graph.listen("/tf", self._on_tf)
        self.graph.listen("/control/final", lambda message: setattr(self, "last", message.control))
        self.graph.listen("/in_flight_status", lambda text: setattr(self, "status", text.data))
        for name in self.classes:
            self.start(f"/{name}")
        self.graph.advance(2.0)

    def _on_tf(self, message):
        for each in message.transforms:
            if each.child_frame_id == "crazyflie":
                p = each.transform.translation
                self.position = (p.x, p.y, p.z)

    def start(self, name):
        self.graph.start(name, self.classes[name[1:]]())

    def take_off(self):
        outcome = self.graph.call("/takeoff", EmptyRequest())
        self.graph.advance(8.0)
        assert outcome.result(0) is not None

    def refer(self, x, y, z):
        message = PositionVelocityStateStamped()
        message.header.stamp = self.graph.stamp()
        message.state.x, message.state.y, message.state.z = x, y, z
        self.graph.publish("/ref", message)

    def change(self, node=FENCE, **values):
        """Change parameters as dynamic_reconfigure does; `box_max_x` is box/max/x."""
        names = {name.replace("_", "/"): value for name, value in values.items()}
        request = ReconfigureRequest(encode_config(names))
        return self.graph.call(f"{node}/set_parameters", request).result(0)

    @property
    def flies(self):
        return self.status.startswith("flying") and self.last.thrust > 4.0


@pytest.fixture
def flight():
    flight = FencedFlight()
    flight.take_off()
    return flight


def test_a_box_that_is_enlarged_in_flight_is_enlarged_for_all(flight):
    """5 m away the vehicle is outside of the box of the launch, and of half a metre more."""
    flight.change(box_max_x=8.0)
    flight.refer(5.0, 0.0, 1.0)
    flight.graph.advance(15.0)
    assert flight.position[0] == pytest.approx(5.0, abs=0.1)
    assert flight.flies
    # A filter that is restarted there receives the present box.
    flight.graph.kill(FILTER)
    flight.graph.advance(0.3)
    flight.start(FILTER)
    flight.graph.advance(3.0)
    assert flight.flies
    landing = flight.graph.call("/land", EmptyRequest())
    flight.graph.advance(10.0)
    assert landing.result(0) is not None
    assert flight.status.startswith("on ground")


def test_a_fence_that_is_restarted_has_the_box_that_it_had(flight):
    flight.change(box_max_x=8.0)
    flight.refer(5.0, 0.0, 1.0)
    flight.graph.advance(15.0)
    flight.graph.kill(FENCE)
    flight.graph.advance(1.0)
    flight.start(FENCE)
    flight.graph.advance(3.0)
    assert flight.flies


def test_a_box_that_leaves_the_vehicle_outside_brings_it_back_in(flight):
    flight.refer(1.0, 0.0, 1.0)
    flight.graph.advance(8.0)
    flight.change(box_min_x=-3.0, box_max_x=-1.0)
    flight.graph.advance(15.0)
    assert flight.flies
    assert -3.0 < flight.position[0] < -1.0
    # From then on the wall acts like any other.
    flight.graph.kill("/control_merger")
    flight.graph.kill(FENCE)
    flight.graph.advance(0.05)
    flight.graph.faults["/state"] = _shifted(2.0)
    flight.graph.advance(0.3)
    assert "outside the geofence" in flight.status


def _shifted(x):
    def change(message):
        message.state.x += x
        return [message]

    return change


def test_far_outside_the_present_box_the_motors_are_stopped(flight):
    flight.change(box_max_x=8.0)
    flight.graph.advance(0.5)
    flight.graph.faults["/state"] = _shifted(8.4)
    flight.graph.advance(0.5)
    assert flight.last.thrust > 4.0
    flight.graph.faults["/state"] = _shifted(9.5)
    flight.graph.advance(0.5)
    assert flight.last.thrust == 0.0
    assert "m outside the geofence" in flight.status


def test_the_hover_point_must_be_in_the_present_box():
    flight = FencedFlight()
    with pytest.raises(ServiceError, match="outside the geofence"):
        flight.change("/takeoff_server", hover_x=3.0)
    flight.change(box_min_x=1.0, box_max_x=5.0)
    flight.graph.advance(1.0)
    with pytest.raises(ServiceError, match=r"hover/x, y, z is .* 1.00 m outside the geofence"):
        flight.graph.call("/takeoff", EmptyRequest()).result(0)
    assert "outside the geofence" in flight.status
    flight.change("/takeoff_server", hover_x=3.0)


def test_a_fence_that_is_switched_off_has_no_box():
    flight = FencedFlight(merger_mode="LQR")
    flight.take_off()
    flight.refer(3.0, 0.0, 1.0)
    flight.graph.advance(12.0)
    assert flight.position[0] == pytest.approx(3.0, abs=0.1)
    assert flight.flies


def test_near_a_wall_a_control_that_is_safe_passes_in_its_own_period(flight):
    flight.refer(1.35, 0.0, 1.0)
    flight.graph.advance(6.0)
    regular, merged = {}, {}
    for topic, found in (("/control/lqr", regular), ("/control/merged", merged)):
        flight.graph.listen(
            topic, lambda m, found=found: found.update({m.header.stamp.to_nsec(): m.control})
        )
    priorities = []
    flight.graph.listen("/control/geofence", lambda m: priorities.append(m.control.priority))
    flight.refer(1.42, 0.3, 1.1)
    flight.graph.advance(4.0)
    assert sum(priorities) > 10.0
    assert all(merged[stamp] == control for stamp, control in regular.items())


@pytest.mark.parametrize("controller", ["position_velocity_yaw", "full_state"])
def test_another_controller_does_not_leave_the_box_either(controller):
    """The fence has the state of 7 numbers, the controller its own."""
    flight = FencedFlight(controller=controller, dynamics="quadrotor")
    flight.take_off()
    farthest = 0.0
    for x in (1.0, 1.8, 2.6):
        flight.refer(x, 0.0, 1.0)
        for _ in range(40):
            flight.graph.advance(0.1)
            farthest = max(farthest, flight.position[0])
    assert 1.4 < farthest < 1.5
    assert flight.flies
    flight.refer(1.0, 0.0, 1.0)
    flight.graph.advance(8.0)
    assert flight.position == pytest.approx((1.0, 0.0, 1.0), abs=0.1)


class OnControlMerger(RegularControlMergerNode):
    """The merger of other implementations: it publishes with a regular control only."""

    def _on_prioritized(self, message):
        self._merger.prioritize(*self.split(message.control), self._handle.time())


def test_a_merger_that_is_a_period_behind_the_fence_does_not_lead_out():
    flight = FencedFlight(classes={"control_merger": OnControlMerger}, dynamics="quadrotor")
    flight.take_off()
    farthest = 0.0
    for x, y in ((1.8, 0.0), (2.6, 2.0), (-3.0, 2.0)):
        flight.refer(x, y, 1.0)
        for _ in range(40):
            flight.graph.advance(0.1)
            farthest = max(farthest, *map(abs, flight.position[:2]))
    assert 1.4 < farthest < 1.5
    assert flight.flies


class PillarFlight(FencedFlight):
    """Among the obstacles of the laboratory."""

    nearest = math.inf  #: To the middle of the pillar (m).

    def _on_tf(self, message):
        super()._on_tf(message)
        x, y, _ = self.position
        self.nearest = min(self.nearest, math.hypot(x + 1.3, y - 1.2))

    def stopped_in_front_of_it(self):
        """Return whether it came near: the pillar's radius is 0.15 m, and 0.1 m are kept free."""
        return self.flies and 0.25 < self.nearest < 0.35


def test_flown_straight_at_a_pillar_it_stops_in_front_of_it():
    flight = PillarFlight(EXAMPLES / "sw_obstacles.launch")
    flight.take_off()
    flight.refer(-1.3, 1.2, 1.0)
    flight.graph.advance(10.0)
    assert flight.stopped_in_front_of_it()
    flight.refer(0.0, 0.0, 1.0)
    flight.graph.advance(10.0)
    assert flight.position == pytest.approx((0.0, 0.0, 1.0), abs=0.1)


def test_a_joystick_that_steers_at_the_pillar_stops_in_front_of_it():
    """The command of the README, by the controller that turns the nose."""
    flight = PillarFlight(TELEOP / "teleop.launch", flight="sw_obstacles.launch", joy=False)
    flight.graph.publish("/joy", Joy(buttons=[0, 0, 1]))
    flight.graph.advance(8.0)
    for _ in range(100):
        flight.graph.publish("/joy", Joy(axes=[0.0, 0.0, 0.0, 1.2 / 1.3, -1.0]))
        flight.graph.advance(0.1)
    assert flight.stopped_in_front_of_it()
