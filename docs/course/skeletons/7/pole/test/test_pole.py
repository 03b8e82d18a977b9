"""The pole, first the algorithm, then the node on a fake process."""

import pytest
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

from crazyflie_utils.testing import FakeProcess
from pole.pole import Pole
from pole.pole_node import GREEN, RED, PoleNode


@pytest.mark.parametrize(
    ("point", "expected"),
    [((1.0, 0.0, 0.5), 0.0), ((2.5, 0.0, 0.5), 1.0), ((1.0, 0.0, 3.0), 1.0), ((4.5, 0, 6), 5.0)],
)
def test_distance(point, expected):
    pole = Pole(x=1.0, y=0.0, radius=0.5, height=2.0)
    assert pole.distance(point) == pytest.approx(expected)


@pytest.fixture
def process():
    """Return a process with a pole at (0, 0)."""
    fake = FakeProcess()
    assert fake.launch(PoleNode(), "/pole", {"x": 0.0, "y": 0.0, "near": 0.5})
    return fake


def see_at(process, x):
    """Place the vehicle at x (m); return marker and distance."""
    transform = TransformStamped(child_frame_id="crazyflie")
    transform.header.frame_id = "world"
    transform.header.stamp.secs = int(process.clock.time())
    transform.transform.translation.x = x
    transform.transform.rotation.w = 1.0
    process.publish("/tf", TFMessage([transform]))
    process.advance(0.1)
    return process.published("/pole/marker")[-1], process.published("/pole/distance")[-1].data


def test_turns_red_when_the_vehicle_is_near(process):
    marker, distance = see_at(process, 1.0)
    assert distance == pytest.approx(0.95)
    assert (marker.type, marker.color) == (Marker.CYLINDER, GREEN)
    assert marker.header.frame_id == "world"
    process.advance(1.0)
    marker, distance = see_at(process, 0.4)
    assert distance == pytest.approx(0.35)
    assert marker.color == RED


def test_the_marker_stands_where_the_pole_does():
    process = FakeProcess()
    place = {"x": 2.0, "y": -1.0, "radius": 0.1, "height": 1.2}
    assert process.launch(PoleNode(), "/pole", place)
    marker, _ = see_at(process, 0.0)
    position, scale = marker.pose.position, marker.scale
    assert (position.x, position.y, position.z) == pytest.approx((2.0, -1.0, 0.6))
    assert (scale.x, scale.y, scale.z) == pytest.approx((0.2, 0.2, 1.2))
    assert marker.pose.orientation.w == 1.0


def test_says_when_it_sees_no_vehicle(process):
    process.advance(0.1)
    assert process.published("/pole/marker") == []
    assert "no transform world -> crazyflie" in process.logged("warn")[0]
