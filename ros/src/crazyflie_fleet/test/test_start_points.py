"""Vehicles with one start point in the fleet file, as motion capture finds them."""

import pytest

from crazyflie_fleet import fleet_file
from crazyflie_fleet.references_node import ReferencesNode
from crazyflie_msgs.msg import (
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing import FakeProcess

FLEET = fleet_file.parse(
    "robots: {a: {initial_position: [0, 0, 0]}, b: {initial_position: [0, 0, 0]}, "
    "c: {initial_position: [3, 0, 0]}}"
)


class Scene:
    def __init__(self):
        self.process = FakeProcess()
        node = ReferencesNode(FLEET, FLEET.names, "world")
        assert self.process.launch(node, "/fleet/references")

    def see(self, **places):
        for name, (x, y) in places.items():
            state = PositionVelocityYawState(x=x, y=y)
            self.process.publish(f"/{name}/state", PositionVelocityYawStateStamped(state=state))
        self.process.advance(0.3)

    def refusal(self, name):
        return self.process.published(f"/{name}/takeoff_inhibition")[-1].data


def test_takeoffs_are_refused_until_the_vehicles_are_seen_apart():
    scene = Scene()
    what = "a and b start at one place by the fleet file, and"
    assert scene.refusal("a") == f"{what} the positions of both are not known"
    scene.see(a=(0.0, 0.0), b=(0.1, 0.0), c=(3.0, 0.0))
    assert scene.refusal("b") == f"{what} are 0.10 m apart; expected at least 0.30 m"
    scene.see(a=(0.0, 0.0), b=(2.0, 1.0), c=(3.0, 0.0))
    assert scene.refusal("a") == scene.refusal("b") == ""
    with pytest.raises(KeyError, match="no publisher of /c/takeoff_inhibition"):
        scene.refusal("c")
    # One check is enough: they may land next to each other.
    scene.see(a=(0.0, 0.0), b=(0.2, 0.0))
    assert scene.refusal("b") == ""


def test_takeoffs_end_above_where_the_vehicle_is_seen():
    scene = Scene()
    scene.see(a=(0.0, 0.0), b=(2.0, 1.0), c=(2.5, 0.0))
    hover = PositionVelocityStateStamped(state=PositionVelocityState(z=1.0))
    scene.process.publish("/b/ref", hover)
    followed = scene.process.published("/b/ref_safe")[-1].state
    assert (followed.x, followed.y, followed.z) == (2.0, 1.0, 1.0)
    there = PositionVelocityStateStamped(state=PositionVelocityState(x=3.0, z=1.0))
    scene.process.publish("/c/ref", there)
    followed = scene.process.published("/c/ref_safe")[-1].state
    assert (followed.x, followed.y, followed.z) == (3.0, 0.0, 1.0)


@pytest.mark.parametrize(
    "failing", ["references_node.close_pairs", "landing_rounds.SafeDescents.begin"]
)
def test_references_pass_while_the_check_of_starts_or_a_descent_fails(failing, monkeypatch):
    def fail(*arguments):
        raise ValueError("fails")

    scene = Scene()
    monkeypatch.setattr(f"crazyflie_fleet.{failing}", fail)
    scene.see(a=(0.0, 0.0), b=(2.0, 1.0), c=(3.0, 0.0))
    scene.process.publish("/c/ref_descent", PositionVelocityStateStamped())
    assert "fails" in scene.process.logged("error")[0]
    there = PositionVelocityStateStamped(state=PositionVelocityState(x=3.5, z=1.0))
    scene.process.publish("/c/ref", there)
    assert scene.process.published("/c/ref_safe")[-1].state.x == 3.5
