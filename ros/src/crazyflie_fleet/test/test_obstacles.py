"""Bodies of a fleet file without a connection: seen, kept apart from, never flown."""

import pytest
import rospy
from geometry_msgs.msg import Point, Transform, TransformStamped, Vector3
from simulated_fleet import Swarm
from std_msgs.msg import Header
from test_connect_node import Driver
from tf2_msgs.msg import TFMessage

from crazyflie_driver.srv import GoToRequest
from crazyflie_fleet import fleet_file
from crazyflie_fleet.connect_node import FleetConnectNode
from crazyflie_fleet.fleet_markers_node import FleetMarkersNode
from crazyflie_fleet.mocap_process import make_nodes as make_mocap_nodes
from crazyflie_fleet.references_node import ReferencesNode
from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
)
from crazyflie_msgs.msg import PositionVelocityYawStateStamped as State
from crazyflie_utils import ParameterError
from crazyflie_utils.testing import FakeProcess
from mocap_optitrack.mocap_parameters import MocapParameters

FLEET = """
robots:
  cf1:
    uri: radio://0/90/2M/E7E7E7E701
    initial_position: [0, 0, 0]
  turtlebot1:
    initial_position: [1, 0, 0.9]
    type: turtlebot
robot_types:
  turtlebot:
    connection: none
    motion_capture: {tracking: librigidbodytracker, marker: turtle, dynamics: default}
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "fleet.yaml"
    path.write_text(FLEET)
    return str(path)


def test_it_is_none_of_the_vehicles(file):
    fleet = fleet_file.load(file)
    assert fleet.names == ("cf1",)
    assert [each.name for each in fleet.obstacles] == ["turtlebot1"]
    assert fleet.warnings == ()


def test_nothing_flies_it_and_vehicles_keep_apart_from_it(file):
    swarm = Swarm(fleet={"file": file})
    assert not [name for name in swarm.nodes if name.startswith("/turtlebot1")]
    assert not [name for name in swarm.process.transport.services if "turtlebot1" in name]
    swarm.call("/all/takeoff")
    swarm.call("/cf1/go_to", GoToRequest(0, False, Point(1.5, 0, 1), 0.0, rospy.Duration(5)))
    swarm.process.advance(8.0)
    # Its buffer and the vehicle's are 0.15 m each.
    x, y, z = swarm.position("cf1")
    assert 0.5 < x < 0.75
    assert (y, z) == pytest.approx((0.0, 1.0), abs=0.05)
    swarm.call("/all/land", seconds=10.0)
    assert swarm.position("cf1")[2] == pytest.approx(0.0, abs=0.02)


def test_the_others_are_connected_without_it(file):
    process = FakeProcess()
    driver = Driver(process)
    assert process.launch(FleetConnectNode(), "/fleet_add", {"fleet/file": file})
    assert process.exit_status == 0
    assert list(driver.added) == ["cf1"]


def test_motion_capture_sees_it(file):
    process = FakeProcess()
    handle = process.handle("/mocap_node")
    handle.set_param("/mocap_node/fleet/file", file)
    make_mocap_nodes(handle)
    told = handle.load(MocapParameters)
    frames = {body.key: body.child_frame_id for body in told.bodies}
    assert frames == {"cf1": "cf1", "turtlebot1": "turtlebot1"}


def test_it_is_drawn(file):
    process = FakeProcess()
    assert process.launch(FleetMarkersNode(), "/fleet_markers", {"fleet/file": file})
    process.advance(1.1)
    markers = process.published("/fleet/markers")[-1].markers
    assert {marker.header.frame_id for marker in markers} == {"cf1", "turtlebot1"}


class Tracked:
    """A vehicle in flight, and an obstacle that motion capture sees."""

    def __init__(self, file):
        self.process = FakeProcess()
        fleet = fleet_file.load(file)
        assert self.process.launch(ReferencesNode(fleet, fleet.names, "world"), "/references")
        status = FlightStatus(state=FlightStatus.FLYING)
        self.process.publish("/cf1/in_flight_flight_status", status)

    def advance(self, seconds, place=None):
        """Advance the time, with the obstacle at a place (m), or unseen."""
        for _ in range(round(seconds / 0.05)):
            state = PositionVelocityYawState(z=1.0)
            self.process.publish("/cf1/state", State(state=state))
            if place is not None:
                header = Header(0, self.process.clock.stamp(), "world")
                transform = Transform(translation=Vector3(*place))
                transform.rotation.w = 1.0
                message = TFMessage([TransformStamped(header, "turtlebot1", transform)])
                self.process.publish("/tf", message)
            self.process.advance(0.05)

    def want(self, x):
        """Publish a reference of the vehicle."""
        message = PositionVelocityStateStamped(state=PositionVelocityState(x=x, z=1.0))
        message.header.stamp = self.process.clock.stamp()
        self.process.publish("/cf1/ref", message)

    def held(self):
        """Return the names of vehicles that are held."""
        messages = self.process.published("/fleet/waiting")
        return messages[-1].data if messages else ""


def test_it_is_kept_apart_from_where_it_is_seen_and_not_where_it_began(file):
    tracked = Tracked(file)
    tracked.advance(0.2, (-2.0, 0.0, 1.0))
    tracked.want(0.8)
    tracked.advance(0.2, (-2.0, 0.0, 1.0))
    assert tracked.held() == ""
    tracked.advance(0.2, (0.25, 0.0, 1.0))
    assert tracked.held() == "cf1"


def test_in_flight_an_unseen_one_is_reported(file):
    tracked = Tracked(file)
    tracked.advance(0.1)
    text = "turtlebot1 is not flown, and no state of it has come for 0.5 s: its position is not"
    (warning,) = tracked.process.logged("warn")
    assert text in warning


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("connection: none", "connection: radio", "is 'radio'; expected one of crazyflie, none"),
        ("connection: none", "conection: none", "is not known; expected connection"),
        (
            "    type: turtlebot",
            "    type: turtlebot\n    positioning: flow",
            "is flow of a body without a connection; expected mocap",
        ),
        (
            "marker: turtle",
            "marker: default_single_marker",
            "is librigidbodytracker with the marker default_single_marker, of a body without",
        ),
        ("    uri:", "    connection: none\n    uri:", "has no enabled vehicle with a connection"),
        (
            "    uri: radio://0/90/2M/E7E7E7E701",
            "    id: 2\n    uri: radio://0/90/2M/E7E7E7E701",
            "id is 2, and its address radio://0/90/2M/E7E7E7E701 ends with 01 \\(1\\); expected",
        ),
        (
            "  turtlebot1:",
            "    id: 1\n  cf2:\n    initial_position: [0, 3, 0]\n    id: 1\n  turtlebot1:",
            "id is 1, which is also that of cf1 in line 6; expected another",
        ),
    ],
)
def test_a_key_that_changes_the_meaning_is_never_only_remarked_on(tmp_path, old, new, text):
    path = tmp_path / "fleet.yaml"
    assert old in FLEET
    path.write_text(FLEET.replace(old, new, 1))
    with pytest.raises(ParameterError, match=text):
        fleet_file.load(path)
