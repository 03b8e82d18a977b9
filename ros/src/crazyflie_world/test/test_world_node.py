"""The node on a fake process, and its launch file."""

from pathlib import Path

import pytest
import rospkg
from visualization_msgs.msg import Marker

from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils.testing import FakeProcess, launch_files
from crazyflie_world.world_node import WorldNode

PACKAGE = Path(rospkg.RosPack().get_path("crazyflie_world"))
LAB = str(PACKAGE / "config" / "lab.yaml")


def launch(**parameters):
    process = FakeProcess()
    assert process.launch(WorldNode(), "/world", {"world": LAB} | parameters)
    return process


def pose(process):
    return process.published("/world/ball/pose")[-1]


def test_markers():
    process = launch()
    (array,) = process.published("/world/markers")
    markers = {marker.ns: marker for marker in array.markers}
    assert len(markers) == len(array.markers) == 8
    assert (markers["ball"].type, markers["ball"].header.frame_id) == (Marker.SPHERE, "ball")
    assert markers["ball"].pose.position.x == 0.0
    pillar = markers["pillar"]
    assert (pillar.type, pillar.header.frame_id) == (Marker.CYLINDER, "world")
    assert (pillar.pose.position.x, pillar.scale.x, pillar.scale.z) == (-1.3, 0.3, 2.0)
    assert all(marker.scale.z > 0.0 and marker.color.a == 1.0 for marker in array.markers)


def test_the_ball_moves_on_its_path():
    process = launch()
    lookup = process.handle("/other").listen_to_transforms()
    process.advance(7.5)
    message = pose(process)
    assert message.header.frame_id == "world"
    assert message.header.stamp.to_sec() == pytest.approx(107.5)
    position = message.pose.position
    assert (position.x, position.y, position.z) == pytest.approx((0.0, 1.2, 1.0), abs=1e-6)
    assert lookup("world", "ball").transform.translation.y == position.y
    assert len(process.published("/world/ball/pose")) == pytest.approx(375, abs=1)


def test_paths_may_wait_for_a_flight():
    process = launch(**{"topics/flight_status": "/in_flight_flight_status"})
    for state in ("on_ground", "taking_off"):
        process.publish(
            "/in_flight_flight_status", FlightStatus(state=getattr(FlightStatus, state.upper()))
        )
        process.advance(7.5)
        assert pose(process).pose.position.x == 1.2
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    process.advance(7.5)
    # A second flight does not begin them again.
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    assert pose(process).pose.position.y == pytest.approx(1.2)


def test_a_bad_world_ends_the_node(tmp_path):
    file = tmp_path / "room.yaml"
    file.write_text("floor: {size: [4, -4]}\n")
    process = FakeProcess()
    assert not process.launch(WorldNode(), "/world", {"world": str(file)})
    assert f"{file}:1" in process.logged("error")[0]
    assert not FakeProcess().launch(WorldNode(), "/world")


@pytest.mark.parametrize("composed", ["false", "true"])
def test_launch_file(composed):
    nodes, parameters = launch_files.expand(
        PACKAGE / "launch" / "world.launch",
        composed=composed,
        world_flight_status_topic="/in_flight_flight_status",
    )
    assert ("/world" in nodes) == (composed == "false")
    process = FakeProcess(parameters)
    assert process.launch(WorldNode(), "/world")
    assert "/in_flight_flight_status" in process.transport.subscribers
