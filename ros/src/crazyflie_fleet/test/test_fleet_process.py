"""The process that flies a fleet, without ROS: all nodes on hand-moved time."""

from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest
import rospkg
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import Float32, String
from std_srvs.srv import EmptyRequest

from crazyflie_driver.srv import GoToRequest
from crazyflie_fleet import lander
from crazyflie_fleet.fleet_process import make_nodes
from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils import Node, ParameterError, ServiceError
from crazyflie_utils.parameters.types import FRAME, Number
from crazyflie_utils.testing import FakeProcess

GAINS = Path(rospkg.RosPack().get_path("crazyflie_lqr")) / "config"
NODES = {
    "simulator": {"time_step": 0.02},
    "state_estimator": {"time_step": 0.02},
    "takeoff_server": {"duration": {"hover": 3.0}},
    "lqr_controller": {
        "K_file": str(GAINS / "K_hover.txt"),
        "u_ref_file": str(GAINS / "u_ref_hover.txt"),
    },
}


class Waver(Node):
    """Something beside what flies a vehicle."""

    def load_parameters(self, handle):
        self.frames = [handle.get_param(f"~frames/{each}", FRAME) for each in ("fixed", "robot")]
        self.tilt = handle.get_param("~tilt", Number())

    def register_callbacks(self, handle):
        pass


class Swarm:
    """A simulated fleet."""

    def __init__(self, nodes=NODES, **parameters):
        self.process = FakeProcess()
        self.process.transport.set_param(
            "/fleet", {"simulated": True, "nodes": nodes, **parameters}
        )
        self.nodes = make_nodes(self.process.handle("/fleet"))
        for name, node in self.nodes.items():
            assert self.process.launch(node, name), self.process.logged("error")
        self.process.advance(0.6)

    def call(self, service, request=None, seconds=4.1):
        answer = self.process.call(service, request or EmptyRequest())
        if isinstance(answer, Future):
            self.process.advance(seconds)
            answer = answer.result(0)
        return answer

    def position(self, name):
        state = self.process.published(f"/{name}/state")[-1].state
        return state.x, state.y, state.z


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
    with pytest.raises(ServiceError, match="3 of 3 vehicles: cf1: .*refused"):
        swarm.call("/takeoff_all")
    swarm.call("/cf2/land", seconds=6.0)
    assert swarm.position("cf2")[2] == pytest.approx(0.0, abs=0.02)
    with pytest.raises(ServiceError, match="1 of 3 vehicles: cf2: /cf2/land refused"):
        swarm.call("/land_all", seconds=6.0)
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


class Tower(Swarm):
    """Vehicles above each other, with one beside them."""

    def __init__(self, heights=(1.0, 2.0, 3.0)):
        super().__init__(fleet={"n": 4, "spacing": 1.0})
        self.call("/all/takeoff")
        for name, z in zip(("cf1", "cf2", "cf3"), heights, strict=True):
            self.go_to(name, (-0.5, -0.5, z))

    def go_to(self, name, goal):
        x, y, _ = self.position(name)
        for place in ((x, y, goal[2]), goal):
            request = GoToRequest(0, False, Point(*place), 0.0, rospy.Duration(5.0))
            self.process.call(f"/{name}/go_to", request)
            self.process.advance(6.0)
        assert self.position(name) == pytest.approx(goal, abs=0.1)

    def nearest(self):
        """Return the least distance that a vehicle in the air had; heights count for half."""
        tracks = [self.process.published(f"/cf{k}/state") for k in (1, 2, 3, 4)]
        places = [
            np.array([(m.state.x, m.state.y, 0.5 * m.state.z) for m in track[self.begin :]])
            for track in tracks
        ]
        n = min(map(len, places))
        pairs = [(a[:n], b[:n]) for k, a in enumerate(places) for b in places[:k]]
        return min(
            np.where(np.maximum(a, b)[:, 2] > 0.01, np.linalg.norm(a - b, axis=1), np.inf).min()
            for a, b in pairs
        )

    @property
    def begin(self):
        return self._begin

    def mark(self):
        self._begin = len(self.process.published("/cf1/state"))

    def lands(self, seconds):
        self.process.advance(seconds)
        return [self.process.published(f"/cf{k}/in_flight_state")[-1].data for k in (1, 2, 3, 4)]


def test_vehicles_above_each_other_do_not_land_on_each_other():
    tower = Tower()
    tower.mark()
    tower.call("/all/land", seconds=60.0)
    assert [tower.position(f"cf{k}")[2] for k in (1, 2, 3, 4)] == pytest.approx([0.0] * 4, abs=0.02)
    # Buffers are 0.15 m.
    assert tower.nearest() > 0.3
    assert tower.position("cf1") == pytest.approx((-0.5, -0.5, 0.0), abs=0.05)


def end_launch(tower):
    tower.process.prepare_shutdown(tower.nodes)
    # A process lives on for 10 s.
    tower.process.advance(10.0)


def land_the_upper_ones(tower):
    for name in ("cf3", "cf2"):
        tower.process.call(f"/{name}/land", EmptyRequest())
        tower.process.advance(1.0)
    tower.process.advance(25.0)


def empty_the_batteries(tower):
    for _ in range(80):
        for name in ("cf2", "cf3"):
            tower.process.publish(f"/{name}/battery", Float32(2.8))
        tower.process.advance(0.25)


@pytest.mark.parametrize("end", [end_launch, land_the_upper_ones, empty_the_batteries])
def test_a_vehicle_that_lands_by_itself_lands_beside_those_beneath_it(end):
    # As near to each other as their buffers allow.
    tower = Tower((0.7, 1.35, 2.0))
    tower.mark()
    end(tower)
    states = [tower.process.published(f"/cf{k}/in_flight_state")[-1].data for k in (1, 2, 3)]
    down = ["on_ground" if end is end_launch else "flying", "on_ground", "on_ground"]
    assert states == down
    assert tower.nearest() > 0.3
    assert tower.position("cf1")[:2] == pytest.approx((-0.5, -0.5), abs=0.05)


def test_references_of_others_do_not_disturb_a_landing():
    tower = Tower()
    tower.mark()
    answer = tower.process.call("/land_all", EmptyRequest())
    up = PositionVelocityStateStamped(state=PositionVelocityState(x=-0.5, y=-0.5, z=3.0))

    def insist():
        up.header.stamp = tower.process.clock.stamp()
        tower.process.publish("/cf3/ref", up)

    timer = tower.process.add_timer(0.05, insist)
    tower.process.advance(60.0)
    timer.stop()
    answer.result(0)
    assert tower.position("cf3")[2] == pytest.approx(0.0, abs=0.02)
    assert tower.nearest() > 0.3
    # Afterwards its references count again.
    tower.call("/cf3/takeoff")
    tower.process.advance(3.0)
    insist()
    tower.process.advance(0.1)
    assert tower.process.published("/cf3/ref_safe")[-1].state.z == 3.0


def test_vehicles_of_a_mission_that_has_died_are_landed():
    tower = Tower()
    tower.mark()
    for _ in range(10):
        tower.process.publish("/all/mission", String("m1 cf1 cf2 cf3"))
        tower.process.advance(0.5)
    # One that has landed its vehicles may end.
    tower.process.publish("/all/mission", String("m2 cf4"))
    tower.process.publish("/all/mission", String("m2"))
    assert tower.lands(4.0) == ["flying"] * 4
    assert tower.lands(60.0) == ["on_ground"] * 3 + ["flying"]
    assert tower.nearest() > 0.3
    assert tower.process.logged("error") == [
        "/fleet: a mission that flew cf1, cf2, cf3 has said nothing for 5 s and is taken for dead: "
        "landing them"
    ]


def test_a_vehicle_that_cannot_leave_stays_in_the_air_and_is_named():
    tower = Tower()
    go_to = tower.process.transport.services["/cf2/go_to"]
    # It is led to where it is.
    here = Point(*tower.position("cf2"))
    tower.process.transport.services["/cf2/go_to"] = lambda request: go_to(
        GoToRequest(0, False, here, 0.0, request.duration)
    )
    with pytest.raises(ServiceError, match="1 of 4 vehicles: cf2: stays in the air: it is 0.[34]"):
        tower.call("/all/land", seconds=90.0)
    assert tower.position("cf2")[2] > 1.8
    for name in ("cf1", "cf3", "cf4"):
        assert tower.position(name)[2] == pytest.approx(0.0, abs=0.02)
    # Nor does a refusal end the landing of the others.
    tower.process.transport.services["/cf2/go_to"] = go_to
    tower.call("/cf2/go_to", GoToRequest(0, False, Point(-1.5, 0.5, 1.0), 0.0, rospy.Duration(8.0)))
    tower.process.advance(9.0)
    with pytest.raises(ServiceError, match="3 of 4 vehicles: cf1: /cf1/land refused"):
        tower.call("/all/land", seconds=10.0)
    assert tower.position("cf2")[2] == pytest.approx(0.0, abs=0.02)


def test_a_landing_that_fails_is_answered(monkeypatch):
    swarm = Swarm(fleet={"n": 2})
    swarm.call("/all/takeoff")
    monkeypatch.setattr(lander, "next_round", lambda *_: {}["a bug"])
    with pytest.raises(
        ServiceError, match="2 of 2 vehicles: cf1: the landing of the fleet has fail"
    ):
        swarm.call("/all/land")
    monkeypatch.undo()
    swarm.call("/all/land", seconds=6.0)
    assert swarm.position("cf2")[2] == pytest.approx(0.0, abs=0.02)


def test_all_cannot_go_to_one_place():
    swarm = Swarm(fleet={"n": 2})
    with pytest.raises(ServiceError, match="all vehicles cannot go to one place; expected relat"):
        swarm.call("/all/go_to", go_to(1.0, relative=False))


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


def test_models_are_mixed(tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_text(
        "robots:\n  a: {initial_position: [0, 0, 0], model: coupled_7d}\n"
        "  b: {initial_position: [0, 1, 0]}\n"
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
