"""Motion capture of a fleet: what mocap_node is told."""

import pytest
from geometry_msgs.msg import Quaternion, Transform, TransformStamped
from simulated_fleet import NODES
from std_msgs.msg import Header
from std_srvs.srv import EmptyRequest
from test_connect_node import Driver
from tf2_msgs.msg import TFMessage

from crazyflie_fleet import fleet_file, fleet_process
from crazyflie_fleet.connect_node import FleetConnectNode
from crazyflie_fleet.mocap_process import make_nodes
from crazyflie_utils import ParameterError, ServiceError
from crazyflie_utils.testing import FakeProcess
from mocap_optitrack.mocap_parameters import MocapParameters

FLEET = """
robots:
  cf1: {initial_position: [0, 0.5, 0], motion_capture: {tracking: single_marker}}
  cf2: {initial_position: [0, 1.5, 0]}
  cf3: {initial_position: [0, 2.5, 0]}
"""


@pytest.fixture
def told(tmp_path):
    """Return what mocap_node loads: a rigid body of the configuration is cf3."""
    path = tmp_path / "fleet.yaml"
    path.write_text(FLEET)
    process = FakeProcess()
    handle = process.handle("/mocap_node")
    handle.set_param("/mocap_node/fleet/file", str(path))
    handle.set_param("/mocap_node/rigid_bodies", {"7": {"child_frame_id": "cf3"}})
    assert list(make_nodes(handle)) == ["/mocap_node"]
    return handle.load(MocapParameters)


def test_vehicles_with_one_marker_get_their_position_and_tell_their_heading(told):
    (marker,) = told.markers
    assert marker.key == "cf1"
    assert marker.initial_position == (0.0, 0.5, 0.0)
    assert marker.position == "/cf1/external_position"
    assert marker.heading == "/cf1/heading"
    assert marker.child_frame_id == "cf1"


def test_others_are_rigid_bodies_unless_they_are_configured(told):
    frames = {body.key: body.child_frame_id for body in told.rigid_bodies}
    assert frames == {"cf2": "cf2", "7": "cf3"}


def write(path, robots):
    """Write a fleet file with an entry ``motion_capture`` of each robot; return its path."""
    lines = [
        f"  cf{k}: {{uri: 'udp://127.0.0.1:{k}', initial_position: [0, {k}, 0], "
        f"motion_capture: {{{entry}}}}}"
        for k, entry in enumerate(robots, 1)
    ]
    path.write_text("\n".join(["robots:", *lines, ""]))
    return path


def told_of(path, **parameters):
    """Return what mocap_node loads for a fleet file."""
    handle = FakeProcess().handle("/mocap_node")
    for name, value in {"fleet/file": str(path), **parameters}.items():
        handle.set_param(f"/mocap_node/{name}", value)
    make_nodes(handle)
    return handle.load(MocapParameters)


CONFIGURATIONS = {
    "dynamics_configurations": {"slow": {"max_velocity": [1, 1, 0.5], "max_roll": 1.4}},
    "marker_configurations": {"top": {"offset": [0, 0, -0.04], "points": {"p0": [0.01, 0, 0]}}},
}


def test_limits_and_offset_are_those_of_the_configurations(tmp_path):
    own = "tracking: single_marker, dynamics: slow, marker: top"
    path = write(tmp_path / "fleet.yaml", [own, "tracking: single_marker"])
    first, second = told_of(path, **CONFIGURATIONS).markers
    assert (first.max_velocity, first.offset) == ((1.0, 1.0, 0.5), (0.01, 0.0, -0.04))
    assert (second.max_velocity, second.offset) == ((2.0, 2.0, 3.0), (0.0, 0.0, 0.0))


def test_a_configuration_that_is_not_there_is_refused(tmp_path):
    path = write(tmp_path / "fleet.yaml", ["tracking: single_marker, dynamics: fast"])
    text = "cf1/motion_capture/dynamics is 'fast'; expected one of slow, default"
    with pytest.raises(ParameterError, match=text):
        told_of(path, **CONFIGURATIONS)


def test_which_vehicles_have_one_marker(tmp_path):
    robots = (
        "tracking: single_marker",
        "tracking: vendor, marker: default_single_marker",
        "tracking: librigidbodytracker, marker: default_single_marker",
        "tracking: librigidbodytracker",
    )
    fleet = fleet_file.load(write(tmp_path / "fleet.yaml", robots))
    marked = [v.name for v in fleet.vehicles if v.has_single_marker]
    assert marked == ["cf1", "cf3"]


def test_an_unknown_tracking_is_refused(tmp_path):
    path = write(tmp_path / "fleet.yaml", ["tracking: magic"])
    with pytest.raises(
        ParameterError, match=r"tracking .*fleet.yaml:2\) is 'magic'; expected one of vendor"
    ):
        fleet_file.load(path)


def test_they_are_flown_with_the_kalman_filter(tmp_path):
    path = write(tmp_path / "fleet.yaml", ["tracking: single_marker", "tracking: vendor"])
    process = FakeProcess()
    driver = Driver(process)
    assert process.launch(FleetConnectNode(), "/fleet_add", {"fleet/file": str(path)})
    assert driver.updated == {"cf1": ["stabilizer/estimator"]}
    assert process.transport.parameters["/cf1/stabilizer/estimator"] == 2


@pytest.mark.parametrize("frame", ["world", "cf1"])
def test_a_frame_of_motion_capture_is_not_the_fixed_one(tmp_path, frame):
    path = write(tmp_path / "fleet.yaml", ["frame: world" if frame == "world" else ""])
    with pytest.raises(ParameterError, match=f"cf1 has the .*{frame}, which is the fixed frame"):
        told_of(path, **{"frames/fixed": frame})


@pytest.mark.parametrize(
    ("poses", "reason"),
    [
        # Motion capture knows the bodies by the names of the vehicles as well.
        ([("world", "cf1"), ("world", "a")], "frame cf1 has two parents, world on /tf and a on"),
        ([("a", "b"), ("b", "a")], "frames are in a loop, each the parent of the one before: a, b"),
    ],
)
def test_why_there_is_no_pose_is_reported_by_takeoff(tmp_path, poses, reason):
    path = write(tmp_path / "fleet.yaml", ["frame: a", "frame: b"])
    process = FakeProcess()
    process.transport.set_param("/fleet", {"simulated": False, "nodes": NODES})
    process.transport.set_param("/fleet/fleet/file", str(path))
    for name, node in fleet_process.make_nodes(process.handle("/fleet")).items():
        assert process.launch(node, name), process.logged("error")

    def broadcast():
        still = Transform(rotation=Quaternion(w=1.0))
        transforms = [
            TransformStamped(Header(0, process.clock.stamp(), parent), child, still)
            for parent, child in poses
        ]
        process.publish("/tf", TFMessage(transforms))

    process.timers().add(0.01, broadcast)
    process.advance(6.0)
    text = f"/takeoff refused: no state has come on /cf1/state for 0.5 s; {reason}"
    with pytest.raises(ServiceError, match=text):
        process.call("/cf1/takeoff", EmptyRequest())
