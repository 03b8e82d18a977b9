"""A fleet whose vehicles have geofences."""

import math

import pytest
from simulated_fleet import NODES, Swarm

from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped

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
