"""Motion capture of a fleet: what mocap_node is told."""

import pytest
from test_connect_node import Driver

from crazyflie_fleet import fleet_file
from crazyflie_fleet.connect_node import FleetConnectNode
from crazyflie_fleet.mocap_process import make_nodes
from crazyflie_utils import ParameterError
from crazyflie_utils.testing import FakeProcess
from mocap_optitrack.parameters import MocapParameters

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
    assert marker.parameters.initial_position == (0.0, 0.5, 0.0)
    assert marker.parameters.position == "/cf1/external_position"
    assert marker.parameters.heading == "/cf1/heading"
    assert marker.parameters.child_frame_id == "cf1"


def test_others_are_rigid_bodies_unless_they_are_configured(told):
    frames = {body.key: body.parameters.child_frame_id for body in told.rigid_bodies.bodies}
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


def test_which_vehicles_have_one_marker(tmp_path):
    robots = (
        "tracking: single_marker",
        "tracking: vendor, marker: default_single_marker",
        "tracking: librigidbodytracker, marker: default_single_marker",
        "tracking: librigidbodytracker",
    )
    fleet = fleet_file.load(write(tmp_path / "fleet.yaml", robots))
    marked = [v.name for v in fleet.vehicles if v.settings.has_single_marker]
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
