"""The nodes on a fake process, and the launch files."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import Point, PointStamped, Quaternion, Transform, TransformStamped, Vector3
from sensor_msgs.msg import CameraInfo, Image
from test_camera import CONFIG
from tf2_msgs.msg import TFMessage

from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import FakeProcess, launch_files
from crazyflie_vision.camera_node import CameraNode
from crazyflie_vision.filter_nodes import BlurNode, EdgesNode, GreyNode, ThresholdNode
from crazyflie_vision.follow_node import FollowNode
from crazyflie_vision.images import to_array
from crazyflie_vision.tracker_nodes import ColourTrackerNode, FaceDetectorNode

WORLD = """\
floor: {size: [6, 6]}
objects:
  - type: ball
    name: ball
    radius: 0.1
    colour: [0.95, 0.4, 0.05]
    path: {type: circle, centre: [0, 0, 1], radius: 1, period: 30}
"""


def say(process, frame, x, y, z, yaw=0.0):
    """Tell tf where a frame is."""
    transform = TransformStamped(child_frame_id=frame)
    transform.header.stamp = process.clock.stamp()
    transform.header.frame_id = "world"
    rotation = Quaternion(*quaternion_from_rpy(0.0, 0.0, yaw))
    transform.transform = Transform(Vector3(x, y, z), rotation)
    process.publish("/tf", TFMessage([transform]))


@pytest.fixture
def files(tmp_path):
    """Return the parameters of a camera without noise, 10 images a second, 0.03 s late."""
    (tmp_path / "world.yaml").write_text(WORLD)
    (tmp_path / "camera.yaml").write_text("{rate: 10, noise: 0, latency: 0.03}")
    return {name: str(tmp_path / f"{name}.yaml") for name in ("world", "camera")}


@pytest.fixture
def camera(files):
    """Return a process with a camera that looks at a ball."""
    fake = FakeProcess()
    assert fake.launch(CameraNode(), "/camera", files), fake.logged("error")
    say(fake, "crazyflie", 0.0, 0.0, 1.0)
    say(fake, "ball", 1.0, 0.0, 1.0)
    return fake


def test_images_come_later_than_they_were_taken(camera):
    camera.advance(0.129)
    assert camera.published("/camera/image_raw") == []
    camera.advance(0.002)
    (image,) = camera.published("/camera/image_raw")
    assert image.header.stamp.to_sec() == pytest.approx(100.1)
    assert image.header.frame_id == "crazyflie/camera"
    assert (image.width, image.height, image.encoding) == (320, 240, "bgr8")
    camera.advance(1.0)
    stamps = [each.header.stamp.to_sec() for each in camera.published("/camera/image_raw")]
    assert np.diff(stamps) == pytest.approx(np.full(10, 0.1))


def test_what_the_camera_is_comes_with_each_image(camera):
    camera.advance(1.0)
    infos, images = camera.published("/camera/camera_info"), camera.published("/camera/image_raw")
    assert [info.header for info in infos] == [image.header for image in images]
    assert infos[0].K[0] == pytest.approx(160.0 / math.tan(math.radians(37.5)))
    assert (infos[0].width, infos[0].K[2], infos[0].P[5]) == (320, 159.5, infos[0].K[0])


def test_its_frame_is_in_tf(camera):
    camera.advance(0.1)
    (transform,) = camera.published("/tf")[-1].transforms
    assert transform.header.frame_id == "crazyflie"
    assert transform.child_frame_id == "crazyflie/camera"
    q = transform.transform.rotation
    # The one of the two quaternions whose w is positive.
    rotation = np.copysign(1.0, q.w) * np.array([q.x, q.y, q.z, q.w])
    assert rotation == pytest.approx([-0.5, 0.5, -0.5, 0.5])


def test_without_tf_there_are_no_images(files):
    fake = FakeProcess()
    assert fake.launch(CameraNode(), "/camera", files)
    say(fake, "crazyflie", 0.0, 0.0, 1.0)
    fake.advance(1.0)
    assert fake.published("/camera/image_raw") == []
    assert "no image: " in fake.logged("warn")[0]
    assert "ball" in fake.logged("warn")[0]


def test_from_the_world_to_a_velocity(camera):
    assert camera.launch(ColourTrackerNode(), "/tracker")
    assert camera.launch(FollowNode(), "/follow", {"radius": 0.1})
    # To the right of where it looks, below and farther away.
    camera.advance(0.01)
    say(camera, "ball", 1.2, -0.25, 0.9)
    camera.advance(0.13)
    (target,) = camera.published("/target")
    assert target.header.stamp.to_sec() == pytest.approx(100.1)
    f = 160.0 / math.tan(math.radians(37.5))
    assert target.point.x == pytest.approx(159.5 + f * 0.25 / 1.17, abs=1.0)
    assert target.point.y == pytest.approx(119.5 + f * 0.11 / 1.17, abs=1.0)
    assert target.point.z == pytest.approx(f * 0.1 / 1.17, rel=0.06)
    assert len(camera.published("/tracker/image")) == 1
    camera.advance(0.02)
    velocity = camera.published("/cmd_vel")[-1]
    assert velocity.linear.x == pytest.approx(1.5 * 0.17, abs=0.1)
    assert velocity.linear.y == 0.0
    assert velocity.linear.z == pytest.approx(-1.5 * 0.11, abs=0.03)
    assert velocity.angular.z == pytest.approx(-2.5 * math.atan(0.25 / 1.17), abs=0.03)


def test_bounds_of_the_colour_may_change(camera):
    tracker = ColourTrackerNode()
    assert camera.launch(tracker, "/tracker", {"hue_lower": 100, "hue_upper": 130})
    camera.advance(0.5)
    assert camera.published("/target") == []
    camera.reconfigure("/tracker", hue_lower=0, hue_upper=20)
    camera.advance(0.5)
    assert len(camera.published("/target")) == 5


INFO = CameraInfo(K=[200.0, 0.0, 159.5, 0.0, 200.0, 119.5, 0.0, 0.0, 1.0])


@pytest.fixture
def follow():
    fake = FakeProcess()
    fake.node = FollowNode()
    assert fake.launch(fake.node, "/follow", {"radius": 0.1})
    return fake


def see(process, x=159.5, y=119.5, radius=10.0):
    process.publish("/target", PointStamped(point=Point(x, y, radius)))


def ahead(process):
    return process.published("/cmd_vel")[-1].linear.x


def test_stops_within_0_15_s_of_silence(follow):
    follow.publish("/camera/camera_info", INFO)
    for _ in range(10):
        see(follow)
        follow.advance(0.03)
        assert ahead(follow) == 0.5
    follow.advance(0.07)
    assert ahead(follow) == 0.5
    follow.advance(0.05)
    assert ahead(follow) == 0.0
    see(follow)
    follow.advance(0.02)
    assert ahead(follow) == 0.5


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        ({"radius": 0.0}, "a target of radius 0; expected > 0 (pixels)"),
        ({"x": math.nan}, "its point is not finite"),
    ],
)
def test_bad_targets_are_ignored(follow, target, expected):
    follow.publish("/camera/camera_info", INFO)
    see(follow, **target)
    follow.advance(0.05)
    assert ahead(follow) == 0.0
    assert expected in follow.logged("warn")[0]


@pytest.mark.parametrize("info", [None, CameraInfo(), CameraInfo(K=[math.nan] * 9)])
def test_without_a_camera_it_rests(follow, info):
    if info is not None:
        follow.publish("/camera/camera_info", info)
    see(follow)
    follow.advance(0.05)
    assert ahead(follow) == 0.0
    assert "/camera/camera_info" in follow.logged("warn")[-1]


def test_stops_at_the_end(follow):
    follow.publish("/camera/camera_info", INFO)
    see(follow)
    follow.advance(0.05)
    follow.shut_down({"/follow": follow.node})
    assert ahead(follow) == 0.0


FILTERS = {GreyNode: "mono8", BlurNode: "bgr8", EdgesNode: "mono8", ThresholdNode: "mono8"}


@pytest.mark.parametrize("node", FILTERS)
def test_filters_answer_every_image(camera, node):
    assert camera.launch(node(), "/filter")
    camera.advance(0.5)
    images, results = camera.published("/camera/image_raw"), camera.published("/filter/image")
    assert [each.header for each in results] == [each.header for each in images]
    assert {each.encoding for each in results} == {FILTERS[node]}
    assert to_array(results[0]).shape == (240, 320, 3)


@pytest.mark.parametrize(
    "bad",
    [
        {"encoding": "blue"},
        {"data": b""},
        {"height": 4000},
        {"width": 0, "height": 0, "data": b""},
        {"encoding": "32FC1"},
    ],
)
def test_bad_images_are_dropped(bad):
    fake = FakeProcess()
    assert fake.launch(GreyNode(), "/grey")
    image = Image(width=4, height=4, encoding="bgr8", step=12, data=b"x" * 48)
    for name, value in bad.items():
        setattr(image, name, value)
    fake.publish("/camera/image_raw", image)
    assert fake.published("/grey/image") == []
    assert "ignoring an image of" in fake.logged("warn")[0]
    assert fake.logged("error") == []


@pytest.mark.parametrize(
    ("node", "parameters", "expected"),
    [
        (BlurNode, {"size": 4}, "size is 4; expected an odd integer from 1 to 99 (pixels)"),
        (EdgesNode, {"low": 200.0}, "low is 200; expected <= high, 120"),
        (ThresholdNode, {"level": 256}, "level is 256; expected an integer from 0 to 255"),
        (ColourTrackerNode, {"hue_upper": 200}, "expected an integer from 0 to 179"),
        (FaceDetectorNode, {"cascade": "/no.xml"}, "/tracker/cascade: /no.xml is not a cascade"),
        (FollowNode, {"distance": 0.0}, "distance is 0.0; expected a finite number > 0 (m)"),
        (CameraNode, {"camera": "/no.yaml"}, "/no.yaml: cannot be read"),
    ],
)
def test_bad_parameters_are_named(files, node, parameters, expected):
    fake = FakeProcess()
    given = {**(files if node is CameraNode else {}), **parameters}
    assert not fake.launch(node(), "/tracker", given)
    assert expected in fake.logged("error")[0]


def test_an_invalid_picture_is_named(files, tmp_path):
    (tmp_path / "face.jpg").write_text("no picture")
    (tmp_path / "world.yaml").write_text((CONFIG / "face.yaml").read_text())
    fake = FakeProcess()
    assert not fake.launch(CameraNode(), "/camera", files)
    assert f"{tmp_path}/face.jpg is not a picture that can be read" in fake.logged("error")[0]


CLASSES = {
    "follow_ball": {"camera": CameraNode, "tracker": ColourTrackerNode, "follow": FollowNode},
    "follow_face": {"camera": CameraNode, "tracker": FaceDetectorNode, "follow": FollowNode},
    "basics": {
        "camera": CameraNode,
        "grey": GreyNode,
        "blur": BlurNode,
        "edges": EdgesNode,
        "threshold": ThresholdNode,
    },
}


@pytest.mark.parametrize("composed", ["false", "true"])
@pytest.mark.parametrize("file", CLASSES)
def test_launch_files(file, composed):
    launch = CONFIG.parent / "launch" / f"{file}.launch"
    nodes, parameters = launch_files.expand(launch, composed=composed, rviz="false")
    fake = FakeProcess(parameters)
    for name, node in CLASSES[file].items():
        assert (f"/{name}" in nodes) == (composed == "false")
        assert fake.launch(node(), f"/{name}"), fake.logged("error")
    if composed == "true":
        composition = NODE_CLASSES(launch_files.composed_nodes(parameters))
        assert CLASSES[file].items() <= composition.items()
    assert "/takeoff_caller" in nodes
