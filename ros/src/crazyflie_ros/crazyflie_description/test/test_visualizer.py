"""The visualizer: the path it keeps, and the node on a fake process."""

import math

import pytest
from geometry_msgs.msg import TransformStamped
from hypothesis import given
from hypothesis import strategies as st
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

from crazyflie_description import visualizer_node
from crazyflie_description.visualizer_node import PERIOD, SPACING, FlownPath, VisualizerNode, circle
from crazyflie_msgs.msg import (
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing import FakeProcess

PARAMETERS = {
    "frames/fixed": "world",
    "frames/robot": "crazyflie",
    "topics/reference": "/ref",
    "topics/markers": "/visualizer/markers",
}

COORDINATE = st.floats(-10.0, 10.0)
POSITIONS = st.lists(st.tuples(COORDINATE, COORDINATE, COORDINATE), min_size=1, max_size=30)


@given(POSITIONS, st.floats(0.01, 5.0), st.integers(1, 20))
def test_path_is_spaced_and_bounded_and_stays_near(positions, spacing, capacity):
    path = FlownPath(spacing, capacity)
    for stamp, position in enumerate(positions):
        path.add(stamp, position)
        assert math.dist(path.positions[-1], position) < spacing
    kept = list(path.positions)
    assert len(kept) <= capacity
    assert all(math.dist(a, b) >= spacing for a, b in zip(kept, kept[1:], strict=False))
    assert set(kept) <= set(positions)


def test_path_drops_the_oldest_points():
    path = FlownPath(0.5, 3)
    changed = [path.add(k, (float(k), 0.0, 0.0)) for k in range(5)]
    assert changed == [True] * 5
    assert list(path.positions) == [(2.0, 0.0, 0.0), (3.0, 0.0, 0.0), (4.0, 0.0, 0.0)]


def test_path_restarts_when_time_is_reset():
    path = FlownPath(0.5, 10)
    path.add(5.0, (0.0, 0.0, 0.0))
    path.add(6.0, (0.0, 0.0, 1.0))
    assert not path.add(6.0, (0.0, 0.0, 1.0))
    assert path.add(1.0, (0.0, 0.0, 1.0))
    assert list(path.positions) == [(0.0, 0.0, 1.0)]


def test_circle_is_closed_and_horizontal():
    corners = circle((1.0, 2.0, 3.0), 0.5, 6)
    assert corners[0] == corners[-1] == (1.5, 2.0, 3.0)
    assert len(set(corners)) == 6
    for x, y, z in corners:
        assert z == 3.0
        assert math.hypot(x - 1.0, y - 2.0) == pytest.approx(0.5)
    sides = [math.dist(a, b) for a, b in zip(corners, corners[1:], strict=False)]
    assert sides == pytest.approx([0.5] * 6)


@pytest.fixture
def process():
    """Return a process with a visualizer in it."""
    fake = FakeProcess()
    assert fake.launch(VisualizerNode(), "/visualizer", PARAMETERS)
    return fake


def fly_to(process, z, stamp=None):
    """Tell tf where the vehicle is, and let the visualizer look."""
    transform = TransformStamped()
    transform.header.stamp = process.clock.stamp(stamp)
    transform.header.frame_id = "world"
    transform.child_frame_id = "crazyflie"
    transform.transform.translation.z = z
    transform.transform.rotation.w = 1.0
    process.publish("/tf", TFMessage([transform]))
    process.advance(PERIOD)


def refer_to(process, x, y, z):
    state = PositionVelocityState(x=x, y=y, z=z)
    process.publish("/ref", PositionVelocityStateStamped(state=state))
    process.advance(PERIOD)


def markers(process):
    """Return the markers of the last message, by name."""
    return {marker.ns: marker for marker in process.published("/visualizer/markers")[-1].markers}


@pytest.mark.parametrize("name", PARAMETERS)
def test_every_parameter_is_required(name):
    fake = FakeProcess()
    parameters = {key: value for key, value in PARAMETERS.items() if key != name}
    assert not fake.launch(VisualizerNode(), "/visualizer", parameters)
    assert f"/visualizer/{name} is not set" in fake.logged("error")[0]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("frames/fixed", ""),
        ("frames/robot", 7),
        ("topics/reference", "two words"),
        ("topics/markers", 0.5),
    ],
)
def test_bad_parameters_are_named(name, value):
    fake = FakeProcess()
    assert not fake.launch(VisualizerNode(), "/visualizer", {**PARAMETERS, name: value})
    assert f"/visualizer/{name} is {value!r}; expected" in fake.logged("error")[0]


def test_draws_the_path(process):
    heights = [0.0, 0.1, 0.1 + SPACING / 2.0, 0.2]
    for z in heights:
        fly_to(process, z)
    path = markers(process)["path"]
    assert (path.header.frame_id, path.type, path.action) == (
        "world",
        Marker.LINE_STRIP,
        Marker.ADD,
    )
    assert [point.z for point in path.points] == [0.0, 0.1, 0.2]


def test_draws_references_that_have_a_yaw():
    fake = FakeProcess()
    assert fake.launch(VisualizerNode(), "/visualizer", {**PARAMETERS, "reference/yaw": True})
    state = PositionVelocityYawState(x=0.5, y=0.0, z=1.0, yaw=0.2)
    fake.publish("/ref", PositionVelocityYawStateStamped(state=state))
    fake.advance(PERIOD)
    assert markers(fake)["reference label"].text == "reference (0.50, 0.00, 1.00) m"


def test_says_nothing_new_in_a_hover(process):
    fly_to(process, 0.0)
    refer_to(process, 0.0, 0.0, 1.0)
    fly_to(process, 1.0)
    before = len(process.published("/visualizer/markers"))
    for k in range(20):
        fly_to(process, 1.0 + 0.004 * (-1) ** k)
    assert len(process.published("/visualizer/markers")) == before


def test_path_is_bounded(monkeypatch):
    monkeypatch.setattr(visualizer_node, "CAPACITY", 5)
    fake = FakeProcess()
    assert fake.launch(VisualizerNode(), "/visualizer", PARAMETERS)
    for k in range(8):
        fly_to(fake, float(k))
    assert [point.z for point in markers(fake)["path"].points] == [3.0, 4.0, 5.0, 6.0, 7.0]


def test_path_of_one_point_is_not_drawn(process):
    fly_to(process, 0.0)
    assert markers(process)["path"].action == Marker.DELETE


def test_draws_the_reference(process):
    refer_to(process, 1.0, -2.0, 0.5)
    ring, label = (markers(process)[name] for name in ("reference", "reference label"))
    assert ring.action == label.action == Marker.ADD
    assert {point.z for point in ring.points} == {0.5}
    assert sum(point.x for point in ring.points[1:]) / 64 == pytest.approx(1.0)
    assert sum(point.y for point in ring.points[1:]) / 64 == pytest.approx(-2.0)
    assert label.text == "reference (1.00, -2.00, 0.50) m"
    assert label.pose.position.z > 0.5


def test_no_reference_no_ring(process):
    fly_to(process, 0.0)
    assert markers(process)["reference"].action == Marker.DELETE
    assert markers(process)["reference label"].action == Marker.DELETE


def test_a_reference_that_is_not_finite_does_not_stay(process):
    refer_to(process, 0.0, 0.0, 1.0)
    refer_to(process, math.nan, 0.0, 1.0)
    assert "/ref" in process.logged("warn")[-1]
    assert markers(process)["reference"].action == Marker.ADD
    process.advance(0.6)
    assert markers(process)["reference"].action == Marker.DELETE
    refer_to(process, 0.0, 0.0, 2.0)
    assert markers(process)["reference"].action == Marker.ADD


def test_a_frame_that_never_appears_is_named(process):
    process.advance(2.0)
    warnings = process.logged("warn")
    assert len(warnings) == 1
    assert "world" in warnings[0]
    assert "crazyflie" in warnings[0]
    assert process.published("/visualizer/markers") == []


def test_path_restarts_when_simulated_time_is_reset(process):
    for z in (0.0, 0.5, 1.0):
        fly_to(process, z)
    process.clock.set(1.0)
    fly_to(process, 0.0)
    fly_to(process, 0.25)
    assert [point.z for point in markers(process)["path"].points] == [0.0, 0.25]
