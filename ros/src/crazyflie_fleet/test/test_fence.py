"""A fleet whose vehicles have geofences."""

import math

import pytest
from simulated_fleet import NODES, Swarm

from crazyflie_fleet import fleet_file
from crazyflie_fleet.fleet_process import make_nodes
from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils import ParameterError
from crazyflie_utils.testing import FakeProcess

SIDE = 1.0  #: Of the box, to each side of the first vehicle (m).
BOX = {
    "period": 0.02,
    "box": {
        "min": {"x": -SIDE, "y": -5.0, "z": -1.0},
        "max": {"x": 1.0 + SIDE, "y": 5.0, "z": 3.0},
    },
}


@pytest.mark.parametrize("together", [True, False])
def test_each_vehicle_stays_in_the_box(together):
    swarm = Swarm({**NODES, "geofence": BOX}, fleet={"n": 2}, together=together, fence=True)
    swarm.call("/all/takeoff", seconds=8.0)
    swarm.process.advance(6.0)
    start = [swarm.position(name) for name in ("cf1", "cf2")]
    assert min(z for _, _, z in start) > 0.3
    for _ in range(60):
        for name, side in (("cf1", -3.0), ("cf2", 4.0)):
            _, y, z = swarm.position(name)
            state = PositionVelocityState(x=side, y=y, z=z)
            swarm.process.publish(f"/{name}/ref", PositionVelocityStateStamped(state=state))
        swarm.process.advance(0.1)
        for name in ("cf1", "cf2"):
            assert -SIDE < swarm.position(name)[0] < 1.0 + SIDE
    assert swarm.position("cf1")[0] == pytest.approx(-SIDE, abs=0.1)
    assert swarm.position("cf2")[0] == pytest.approx(1.0 + SIDE, abs=0.1)


@pytest.mark.parametrize("together", [True, False])
def test_each_vehicle_has_half_of_the_room_between_them(together):
    """References that change places."""
    nodes = {**NODES, "geofence": BOX}
    swarm = Swarm(nodes, fleet={"n": 2}, together=together, fence=True)
    swarm.call("/all/takeoff", seconds=8.0)
    swarm.process.advance(6.0)
    nearest = math.inf
    for _ in range(80):
        for name, y in (("cf1", 3.0), ("cf2", -3.0)):
            x, _, z = swarm.position(name)
            state = PositionVelocityState(x=x, y=y, z=z)
            swarm.process.publish(f"/{name}/ref", PositionVelocityStateStamped(state=state))
        swarm.process.advance(0.05)
        nearest = min(nearest, math.dist(swarm.position("cf1"), swarm.position("cf2")))
    buffer = swarm.process.transport.get_param("/cf1/geofence/buffer")
    assert 2.0 * buffer < nearest < 2.0 * buffer + 0.1
    # The separation of references had nothing to do.
    assert [each.data for each in swarm.process.published("/fleet/waiting")] == [""]


def test_a_fleet_file_asks_for_fences(tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_text("fence: true\nrobots:\n  cf1: {initial_position: [0, 0, 0]}\n")
    swarm = Swarm({**NODES, "geofence": BOX}, fleet={"file": str(file)})
    assert {"/cf1/geofence", "/cf1/control_merger"} <= set(swarm.nodes)
    filtered = swarm.process.transport.get_param("/cf1/takeoff_control_filter/topics")
    assert filtered["commanded_control"] == "control/merged"
    file.write_text("fence: maybe\nrobots:\n  cf1: {initial_position: [0, 0, 0]}\n")
    with pytest.raises(ParameterError, match=r"fleet.yaml:1: fence is 'maybe'; expected true"):
        fleet_file.load(file)


@pytest.mark.parametrize(("n", "warned"), [(21, False), (22, True)])
def test_more_vehicles_than_fences_keep_apart_are_named(n, warned):
    process = FakeProcess()
    parameters = {"simulated": True, "fence": True, "fleet": {"n": n}}
    process.transport.set_param("/fleet", {**parameters, "nodes": {**NODES, "geofence": BOX}})
    make_nodes(process.handle("/fleet"))
    others = process.transport.get_param("/cf1/geofence/topics/others")
    assert len(others) == (0 if warned else n - 1)
    [*said] = [text for text in process.logged("warn") if "do not keep them apart" in text]
    assert [f"the fences of {n} vehicles" in text for text in said] == [True] * warned
