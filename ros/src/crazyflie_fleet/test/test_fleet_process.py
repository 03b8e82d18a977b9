"""The process that flies a fleet, without ROS: all nodes on hand-moved time."""

import math
import subprocess
import sys
from collections import Counter

import pytest
import rospy
from geometry_msgs.msg import Point
from simulated_fleet import GAINS, NODES, Swarm

from crazyflie_driver.srv import GoToRequest
from crazyflie_fleet.fleet_process import make_nodes
from crazyflie_fleet.vectorized_simulator_node import VectorizedSimulatorNode
from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils import Node, ParameterError, ServiceError
from crazyflie_utils.parameters.types import FRAME, Number
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.topics import Publisher


def test_a_simulated_fleet_needs_no_cflib():
    program = "import sys; sys.modules['cflib'] = None; import crazyflie_fleet.fleet_process"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


NO_MOCAP = """
robots:
  cf1:
    initial_position: [0, 0, 0]
    motion_capture: {enabled: false}
"""


@pytest.mark.parametrize("name", ["vehicle", "body"])
def test_without_motion_capture_a_vehicle_needs_another_positioning(tmp_path, name):
    file = tmp_path / "fleet.yaml"
    body = (
        "  body: {initial_position: [1, 0, 0], connection: none, motion_capture: {enabled: false}}"
    )
    decked = NO_MOCAP + "    positioning: flow\n"
    file.write_text(NO_MOCAP if name == "vehicle" else decked + body)
    with pytest.raises(ParameterError) as caught:
        Swarm(simulated=False, fleet={"file": str(file)})
    assert str(caught.value).startswith(f"{file}: {'cf1' if name == 'vehicle' else 'body'} has")
    assert "motion_capture/enabled: false; expected true, or positioning: " in str(caught.value)
    # Simulated poses come from no motion capture.
    Swarm(fleet={"file": str(file)})
    file.write_text(decked)
    Swarm(simulated=False, fleet={"file": str(file)})
    if name == "vehicle":
        file.write_text(NO_MOCAP)
        Swarm(simulated=False, fleet={"file": str(file), "positioning": "lighthouse"})


class Waver(Node):
    """A node in addition to those that fly a vehicle."""

    def load_parameters(self, handle):
        self.frames = [handle.get_param(f"~frames/{each}", FRAME) for each in ("fixed", "robot")]
        self.tilt = handle.get_param("~tilt", Number())

    def register_callbacks(self, handle):
        pass


def go_to(z, relative):
    return GoToRequest(0, relative, Point(0.3, 0.0, z), 0.0, rospy.Duration(2.0))


@pytest.mark.parametrize("together", [True, False])
def test_all_take_off_go_and_land(together):
    swarm = Swarm(together=together, fleet={"n": 3})
    swarm.call("/all/takeoff")
    assert swarm.position("cf3") == pytest.approx((0.5, -0.5, 1.0), abs=0.1)
    swarm.call("/all/go_to", go_to(0.2, relative=True))
    swarm.process.advance(2.5)
    assert swarm.position("cf1") == pytest.approx((-0.2, -0.5, 1.2), abs=0.1)
    with pytest.raises(ServiceError, match="refused: all vehicles are flying already"):
        swarm.call("/takeoff_all")
    swarm.call("/cf2/land", seconds=6.0)
    assert swarm.position("cf2")[2] == pytest.approx(0.0, abs=0.02)
    # What is asked of cf2 is so already.
    swarm.call("/land_all", seconds=6.0)
    assert "/fleet: on the ground already: cf2" in swarm.process.logged("info")
    assert swarm.position("cf3")[2] == pytest.approx(0.0, abs=0.02)


def test_together_they_fly_as_each_alone():
    flights = []
    for together in (True, False):
        swarm = Swarm(together=together, fleet={"n": 2})
        swarm.call("/all/takeoff")
        states = [m.state for m in swarm.process.published("/cf2/state")]
        flights.append([(s.x, s.y, s.z, s.x_dot, s.y_dot, s.z_dot, s.yaw) for s in states])
    first, second = flights
    # Who does all at once answers a pose at once, and not at the next tick of an estimator.
    assert first[-1] == pytest.approx(second[-1], abs=1e-3)
    assert max(row[2] for row in first) == pytest.approx(max(row[2] for row in second), abs=0.02)


@pytest.mark.parametrize("models", [3 * ["near_hover"], ["near_hover", "quadrotor", "quadrotor"]])
def test_one_message_on_tf_for_all(tmp_path, models):
    file = tmp_path / "fleet.yaml"
    file.write_text(
        "robots:\n"
        + "".join(
            f"  cf{k}: {{initial_position: [0, {k}, 0], model: {model}}}\n"
            for k, model in enumerate(models)
        )
    )
    swarm = Swarm(fleet={"file": str(file)})
    count = len(swarm.process.published("/tf"))
    swarm.process.advance(0.1)
    messages = swarm.process.published("/tf")[count:]
    assert len(messages) == 5
    for message in messages:
        assert [each.child_frame_id for each in message.transforms] == ["cf0", "cf1", "cf2"]


ONE_PLACE = "robots: {a: {initial_position: [0, 0, 0]}, b: {initial_position: [0, 0.1, 0]}}\n"


def test_vehicles_that_start_at_one_place_do_not_take_off(tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_text(ONE_PLACE)
    swarm = Swarm(fleet={"file": str(file)})
    text = "a and b start at one place by the fleet file, and are 0.10 m apart; expected at least"
    with pytest.raises(ServiceError, match=f"no vehicle takes off: 2 of 2 vehicles: a, b: {text}"):
        swarm.call("/all/takeoff", seconds=11.0)
    assert swarm.position("a")[2] == swarm.position("b")[2] == 0.0


def test_missions_are_told_the_buffers(tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_text(
        "robots:\n  a: {initial_position: [0, 0, 0], buffer: 0.3}\n"
        "  b: {initial_position: [0, 1, 0]}\n"
    )
    parameters = Swarm(fleet={"file": str(file)}).process.transport.parameters
    assert (parameters["/a/buffer"], parameters["/b/buffer"]) == (0.3, 0.15)


def test_emergency_stops_all():
    swarm = Swarm(fleet={"n": 2})
    swarm.call("/all/takeoff")
    swarm.call("/all/emergency")
    swarm.process.advance(1.0)
    assert swarm.position("cf1")[2] == swarm.position("cf2")[2] == 0.0
    with pytest.raises(ServiceError, match="2 of 2 vehicles: cf1.*stopped less than"):
        swarm.call("/all/emergency_reset", seconds=0.1)
    swarm.process.advance(10.0)
    swarm.call("/all/emergency_reset")
    swarm.call("/all/takeoff")
    assert swarm.position("cf2")[2] > 0.5


def test_models_are_mixed(tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_text(
        "robots:\n  a: {initial_position: [0, 0, 0], model: coupled_7d}\n"
        "  b: {initial_position: [0, 1, 0], model: near_hover}\n"
        "  c: {initial_position: [0, 2, 0], model: quadrotor}\n"
    )
    quadrotor = {"lqr_controller": {"K_file": str(GAINS / "K_quadrotor.txt")}}
    swarm = Swarm(fleet={"file": str(file)}, models={"quadrotor": quadrotor})
    assert {"/fleet/near_hover", "/fleet/coupled_7d", "/c/simulator"} <= set(swarm.nodes)
    assert "/a/simulator" not in swarm.nodes
    swarm.call("/all/takeoff")
    for name, y in (("a", 0.0), ("b", 1.0), ("c", 2.0)):
        assert swarm.position(name) == pytest.approx((0.0, y, 1.0), abs=0.1)


def test_more_nodes_of_every_vehicle():
    nodes = {**NODES, "waver": {"tilt": 0.1}}
    swarm = Swarm(nodes, fleet={"n": 2}, further={"waver": f"{__name__}:Waver"})
    assert swarm.nodes["/cf2/waver"].frames == ["world", "cf2"]
    assert swarm.nodes["/cf1/waver"].tilt == 0.1


def test_controls_of_another_launch_fly_none_of_these_vehicles():
    swarm = Swarm()
    process = FakeProcess()
    process.transport.foreign_services["/cf1/control/final/vehicle"] = "/driver"
    process.transport.set_param("/fleet", {"simulated": True, "nodes": NODES})
    nodes = make_nodes(process.handle("/fleet"))
    (name,) = (n for n, node in nodes.items() if isinstance(node, VectorizedSimulatorNode))
    assert not process.launch(nodes[name], name)
    assert "/cf1/control/final already fly a vehicle of /driver" in process.logged("error")[0]
    assert "/cf1/control/final/vehicle" in swarm.process.transport.services


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"further": {"waver": "none:None"}}, "/fleet/further .*expected a dictionary of node"),
        ({"fleet": {"file": "/none.yaml"}}, "/none.yaml: cannot be read"),
        ({"fleet": {"n": 0}}, "/fleet/fleet/n is 0; expected an integer from 1 to 1000"),
        ({"fleet": {"machine": "x"}}, "is flown by the machine 'x'"),
        (
            {"nodes": {**NODES, "simulator": {"time_step": 0.02, "mocap": {"dropout": 0.1}}}},
            "/fleet/nodes/simulator/mocap/dropout has no effect on vehicles that are flown tog",
        ),
        ({"nodes": 3}, "/fleet/nodes is 3; expected a dictionary of dictionaries"),
    ],
)
def test_bad_parameters(parameters, text):
    with pytest.raises(ParameterError, match=text):
        Swarm(**parameters)


@pytest.mark.parametrize("together", [True, False])
def test_vehicles_turn_and_fly_on_at_any_heading(together):
    swarm = Swarm(fleet={"n": 2}, together=together)
    assert swarm.process.transport.parameters["/cf1/high_level/reference/yaw"] is True

    def heading():
        return swarm.process.published("/cf1/state")[-1].state.yaw

    def move(x, y, yaw):
        request = GoToRequest(0, False, Point(x, y, 1.0), yaw, rospy.Duration(3.0))
        swarm.call("/cf1/go_to", request)
        swarm.process.advance(4.0)
        assert swarm.position("cf1") == pytest.approx((x, y, 1.0), abs=0.05)

    swarm.call("/all/takeoff")
    swarm.process.advance(1.0)
    x, y, _ = swarm.position("cf1")
    move(x, y, math.pi / 2.0)
    assert heading() == pytest.approx(math.pi / 2.0, abs=0.02)
    # In this direction a controller that does not know the heading would fly to the side.
    move(x + 0.4, y - 0.3, 2.5)
    assert heading() == pytest.approx(2.5, abs=0.02)
    # A reference that has no heading keeps it, and so do hold and landing.
    state = PositionVelocityState(x=x, y=y, z=1.0)
    swarm.process.publish("/cf1/ref", PositionVelocityStateStamped(state=state))
    swarm.process.advance(3.0)
    assert swarm.position("cf1") == pytest.approx((x, y, 1.0), abs=0.05)
    assert heading() == pytest.approx(2.5, abs=0.02)
    swarm.call("/all/land", seconds=10.0)
    assert swarm.position("cf1")[2] == pytest.approx(0.0, abs=0.02)
    assert heading() == pytest.approx(2.5, abs=0.05)
    # The next takeoff does not turn it back.
    swarm.call("/all/takeoff")
    assert heading() == pytest.approx(2.5, abs=0.05)


@pytest.mark.parametrize("together", [True, False])
def test_a_reference_far_away_is_travelled_to_no_faster_than_the_live_limit(together):
    swarm = Swarm(fleet={"n": 1}, together=together)
    swarm.call("/all/takeoff")
    swarm.process.advance(1.0)
    vectorized = [n for n, node in swarm.nodes.items() if isinstance(node, VectorizedSimulatorNode)]
    node, prefix = (*vectorized, "lqr_controller/") if together else ("/cf1/lqr_controller", "")
    swarm.process.reconfigure(node, **{f"{prefix}reference/max_speed": 0.5})
    x, y, _ = swarm.position("cf1")
    state = PositionVelocityState(x=x + 5.0, y=y, z=1.0)
    swarm.process.publish("/cf1/ref", PositionVelocityStateStamped(state=state))
    swarm.process.advance(4.0)
    assert 1.0 < swarm.position("cf1")[0] - x < 2.0
    swarm.process.advance(10.0)
    assert swarm.position("cf1") == pytest.approx((x + 5.0, y, 1.0), abs=0.05)


def test_a_model_without_a_heading_refuses_one(tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_text("robots: {a: {initial_position: [0, 0, 0], model: near_hover}}\n")
    swarm = Swarm(fleet={"file": str(file)})
    request = GoToRequest(0, True, Point(0.0, 0.0, 0.1), 0.5, rospy.Duration(2.0))
    for service in ("/a/go_to", "/a/high_level/go_to"):
        with pytest.raises(ServiceError, match="the controller keeps the heading 0; expected 0"):
            swarm.call(service, request)


def test_a_moving_vehicle_makes_no_references_that_nobody_reads(monkeypatch):
    is_heard = []
    monkeypatch.setattr(Publisher, "is_heard_outside", lambda self: self.topic in is_heard)
    counts = Counter()
    publish = Publisher.publish

    def counted(self, message, *before):
        counts[self.topic] += 1
        publish(self, message, *before)

    monkeypatch.setattr(Publisher, "publish", counted)
    swarm = Swarm(fleet={"n": 1})
    swarm.call("/all/takeoff")
    swarm.process.advance(3.0)

    def moved(x):
        counts.clear()
        goal, duration = Point(x, 0.0, 1.0), rospy.Duration.from_sec(1.0)
        swarm.call("/cf1/go_to", GoToRequest(0, False, goal, math.nan, duration))
        swarm.process.advance(1.5)
        assert swarm.position("cf1")[0] == pytest.approx(x, abs=0.05)
        return counts["/cf1/ref_safe"], counts["/cf1/ref"]

    inside, outside = moved(0.2)
    assert inside >= 50
    assert outside == 0
    is_heard.append("/cf1/ref")
    inside, outside = moved(0.0)
    assert outside == inside


STACK = """
robots:
  lower: {initial_position: [0, 0, 0], model: quadrotor, hover_height: 0.5}
  upper: {initial_position: [1, 0, 0], model: quadrotor, hover_height: 1.3}
"""


@pytest.mark.parametrize("downwash", [False, True])
def test_a_vehicle_below_another_one_feels_its_downwash(tmp_path, downwash):
    file = tmp_path / "fleet.yaml"
    file.write_text(STACK)
    gains = {"quadrotor": {"lqr_controller": {"K_file": str(GAINS / "K_quadrotor.txt")}}}
    swarm = Swarm(fleet={"file": str(file)}, downwash=downwash, models=gains)
    swarm.call("/all/takeoff", seconds=10.0)
    swarm.call("/upper/go_to", GoToRequest(0, True, Point(-1.0, 0.0, 0.0), 0.0, rospy.Duration(2)))
    swarm.process.advance(4.0)
    assert swarm.position("upper") == pytest.approx((0.0, 0.0, 1.3), abs=0.05)
    controls = swarm.process.published("/lower/control/final")[-50:]
    thrust = sum(each.control.thrust for each in controls) / len(controls)
    assert 1.05 < thrust / 9.81 < 1.2 if downwash else thrust == pytest.approx(9.81, abs=0.05)


def test_downwash_that_no_model_feels_is_warned_of():
    swarm = Swarm(fleet={"n": 2}, downwash=True)
    assert "downwash has an effect on vehicles" in swarm.process.logged("warn")[0]
