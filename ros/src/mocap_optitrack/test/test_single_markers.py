"""Vehicles with one marker: from a virtual camera's frames to topics and tf."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import Float32
from std_srvs.srv import TriggerRequest
from swarm_scenes import RATE, SwapFlight, fly
from test_mocap_node import launch, refusal

from crazyflie_virtual.mocap import MocapScene, MocapSettings
from crazyflie_virtual.natnet import Encoder
from crazyflie_virtual.server import Observation
from mocap_optitrack import natnet_messages
from mocap_optitrack.frames import Frame
from mocap_optitrack.marker_tracker import MarkerTracker, MarkerVehicle

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
STILL = (0.0, 0.0, 0.0)

CF1 = {
    "initial_position": [1.0, 2.0, 0.0],
    "position": "/cf1/external_position",
    "heading": "/cf1/heading",
    "child_frame_id": "cf1",
    "offset": [0.0, 0.0, -0.04],
}
CF2 = {**CF1, "position": "/cf2/external_position", "heading": "/cf2/heading"}
CF2 |= {"initial_position": [1.0, 3.0, 0.0], "child_frame_id": "cf2"}


class VirtualCameras:
    """The virtual motion capture's frames, as bytes, and what the client makes of them."""

    def __init__(self, version, **switches):
        settings = MocapSettings(position_noise=0.0005, single_markers="all", rate=RATE, **switches)
        self._scene = MocapScene(settings)
        self._encoder, self._version = Encoder(version), version

    def see(self, time, positions):
        """Return the unlabelled markers of a frame."""
        for number, position in enumerate(positions):
            place = tuple(float(x) for x in position)
            self._scene.observe(
                Observation(number, str(number), time, place, STILL, UPRIGHT, STILL)
            )
        seen = self._scene.bodies(time), time, time, time, self._scene.markers(time)
        number, payload = natnet_messages.split(self._encoder.frame(1, *seen))
        assert number == natnet_messages.FRAME
        frame = natnet_messages.read_frame(payload, self._version, 1_000_000_000, {}, time)
        assert frame.bodies == ()
        return frame.points


@pytest.mark.parametrize("version", ["3.1", "4.1"])
def test_twenty_vehicles_swap_before_virtual_cameras(version):
    flight = SwapFlight(20)
    vehicles = [MarkerVehicle(str(k), tuple(start)) for k, start in enumerate(flight.starts)]
    cameras = VirtualCameras(version, ghosts=0.3, occlusions=0.2, dropout=0.02)
    score = fly(flight, cameras, MarkerTracker(vehicles).update)
    assert score.swaps == 0
    assert score.tracked > 0.85 * score.frames


def test_markers_that_are_only_flagged_are_unlabelled_too(monkeypatch):
    place = np.array([[1.0, 2.0, 3.0]])
    both = VirtualCameras("4.1").see(1.0, place)
    decode = natnet_messages._decode

    def without_other_markers(*arguments):
        frame = decode(*arguments)
        object.__setattr__(frame, "unlabeled_marker_pos", ())
        return frame

    monkeypatch.setattr(natnet_messages, "_decode", without_other_markers)
    assert VirtualCameras("4.1").see(1.0, place) == both
    assert len(both) == 1


def start(**changes):
    """Return a process with a node that knows two vehicles with one marker."""
    return launch(single_markers={"cf1": CF1, "cf2": CF2}, **changes)


def show(process, node, duration, *points):
    """Process frames for a duration (s)."""
    for _ in range(round(duration * RATE)):
        process.advance(1.0 / RATE)
        node.on_frame(Frame(None, None, process.clock.time(), (), points=points))


def test_positions_are_published_and_poses_with_the_vehicle_s_own_heading():
    process, node = start()
    show(process, node, 0.6, (1.0, 2.0, 0.05), (1.0, 3.0, 0.04))
    position = process.published("/cf1/external_position")[-1]
    assert position.header.frame_id == "world"
    assert (position.point.x, position.point.z) == pytest.approx((1.0, 0.01))
    assert process.published("/tf") == []
    assert "cf1: no heading on /cf1/heading for 2 s" in process.logged("warn")[0]
    process.publish("/cf1/heading", Float32(0.4))
    process.publish("/cf2/heading", Float32(float("nan")))
    show(process, node, 0.05, (1.0, 2.0, 0.05))
    (transform,) = process.published("/tf")[-1].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "cf1")
    assert transform.transform.translation.z == pytest.approx(0.01)
    assert transform.transform.rotation.z == pytest.approx(np.sin(0.2))
    count = len(process.published("/tf"))
    show(process, node, 2.5, (1.0, 2.0, 0.05))
    assert len(process.published("/tf")) < count + 2.1 * RATE


def test_a_vehicle_that_is_lost_is_named_and_put_back():
    process, node = start()
    show(process, node, 0.6, (1.0, 2.0, 0.04), (1.0, 3.0, 0.04))
    show(process, node, 2.5, (1.0, 3.0, 0.04))
    assert any("cf1 is lost" in text for text in process.logged("warn"))
    statuses = {s.name: s for m in process.published("/diagnostics") for s in m.status}
    lost = statuses["mocap_node: single marker cf1"]
    assert lost.level == DiagnosticStatus.ERROR
    assert "its marker is lost; expected one marker" in lost.message
    assert statuses["mocap_node: single marker cf2"].message == "tracked"
    answer = process.call("/mocap_node/reset_lost", TriggerRequest())
    assert (answer.success, answer.message) == (True, "expected at their start points: cf1")
    count = len(process.published("/cf1/external_position"))
    show(process, node, 0.6, (0.9, 2.0, 0.04), (1.0, 3.0, 0.04))
    assert len(process.published("/cf1/external_position")) > count


def test_a_stream_with_y_up():
    process, node = start(up_axis="y")
    show(process, node, 0.6, (1.0, 0.04, -2.0))
    point = process.published("/cf1/external_position")[-1].point
    assert (point.x, point.y, point.z) == pytest.approx((1.0, 2.0, 0.0))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (
            {"single_markers": {"cf1": CF1, "cf2": {**CF2, "initial_position": [1, 2.05, 0]}}},
            "cf2/initial_position is 0.05 m from that of cf1; expected at least 0.1 m",
        ),
        (
            {"single_markers": {"cf1": {"position": "a"}}},
            "cf1/initial_position is not set",
        ),
        (
            {"single_markers": {"cf1": {"initial_position": [0, 0, 0], "child_frame_id": "a"}}},
            "heading is not set; expected a topic, since one marker does not tell the yaw",
        ),
        (
            {"single_markers": {"cf1": {"initial_position": [0, 0, 0]}}},
            "cf1 has neither position nor pose nor pose2d nor child_frame_id",
        ),
        (
            {"single_markers": {"cf1": CF1, "cf2": {**CF2, "child_frame_id": "cf1"}}},
            "cf1 and cf2 share child_frame_id 'cf1'",
        ),
        (
            {"single_markers": {"cf1": {**CF1, "max_velocity": [1, 0, 1]}}},
            "cf1/max_velocity",
        ),
        (
            {"single_markers": {"cf1": CF1}, "rigid_bodies": {"cf1": {"pose": "b"}}},
            "rigid_bodies/cf1 and single_markers/cf1; expected one of them",
        ),
        (
            {"single_markers": {"cf1": CF1}, "rigid_bodies": {"1": {"child_frame_id": "cf1"}}},
            "1 and cf1 share child_frame_id 'cf1'",
        ),
    ],
)
def test_bad_input_is_named(changes, text):
    assert text in refusal(changes)
