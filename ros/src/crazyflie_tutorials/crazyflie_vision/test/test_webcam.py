"""Where images come from that are not simulated; there is no webcam here."""

import threading

import cv2
import numpy as np
import pytest
from test_camera import CONFIG

from crazyflie_utils.testing import FakeProcess, launch_files
from crazyflie_vision.frame_source import FrameSource, open_source
from crazyflie_vision.images import to_array
from crazyflie_vision.webcam_node import WebcamNode

LEVELS = (50, 100, 150)


def picture(level, width=320, height=240):
    return np.full((height, width, 3), level, dtype=np.uint8)


@pytest.fixture
def folder(tmp_path):
    """Return a folder with pictures of some sizes, and something else."""
    for index, level in enumerate(LEVELS):
        cv2.imwrite(str(tmp_path / f"{index}.png"), picture(level, 640 - 160 * index))
    (tmp_path / "README").write_text("no picture")
    return tmp_path


@pytest.fixture
def video(tmp_path):
    file = tmp_path / "video.avi"
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (320, 240))
    for level in LEVELS:
        writer.write(picture(level))
    writer.release()
    return file


def brightness(process):
    return [to_array(each).mean() for each in process.published("/camera/image_raw")]


@pytest.mark.parametrize("kind", ["folder", "video"])
def test_images_in_their_order_over_and_over(request, kind):
    device = str(request.getfixturevalue(kind))
    fake = FakeProcess()
    assert fake.launch(WebcamNode(), "/camera", {"device": device, "rate": 10.0})
    fake.advance(0.5)
    assert brightness(fake) == pytest.approx([50, 100, 150, 50, 100], abs=2.0)
    images, infos = (fake.published(f"/camera/{name}") for name in ("image_raw", "camera_info"))
    assert {(each.width, each.height) for each in images} == {(320, 240)}
    assert [each.header for each in images] == [each.header for each in infos]
    assert infos[0].K[0] == pytest.approx(160.0 / np.tan(np.radians(30.0)))


def test_one_picture():
    fake = FakeProcess()
    assert fake.launch(WebcamNode(), "/camera", {"device": str(CONFIG / "face.jpg")})
    fake.advance(1.0)
    assert len(brightness(fake)) == 30


@pytest.mark.parametrize("device", ["97", "/dev/video97"])
def test_a_missing_camera_is_named(device):
    fake = FakeProcess()
    assert not fake.launch(WebcamNode(), "/camera", {"device": device})
    (error,) = fake.logged("error")
    assert f"parameter /camera/device: the camera {device} does not exist" in error
    assert "available: " in error


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("none.avi", None, "is not a camera, video, picture or folder"),
        ("bad.avi", "x", "is not a video that can be read"),
        ("bad.png", "x", "is not a picture that can be read"),
        ("none.png", None, "is not a picture that can be read"),
        ("", None, "no pictures (.bmp, .jpeg, .jpg, .png) in"),
    ],
)
def test_bad_files_are_named(tmp_path, name, content, expected):
    file = tmp_path / name
    if content is not None:
        file.write_text(content)
    with pytest.raises(OSError, match=str(tmp_path)) as error:
        open_source(str(file), 320, 240, 30.0)
    assert expected in str(error.value)


def unplugged(*_):
    """Return a camera that gives two images, and then is gone."""
    images = [picture(50), picture(100)]

    def read():
        if images:
            return images.pop(0)
        raise OSError("camera 0 gives no more images; was it unplugged?")

    return FrameSource(read, is_live=True)


def test_a_camera_that_is_unplugged_ends_the_node(monkeypatch):
    monkeypatch.setattr("crazyflie_vision.webcam_node.open_source", unplugged)
    is_over = threading.Event()
    monkeypatch.setattr(FakeProcess, "end", lambda _, status: codes.append(status) or is_over.set())
    codes = []
    fake = FakeProcess()
    assert fake.launch(WebcamNode(), "/camera", {"device": "0"})
    assert is_over.wait(30.0)
    assert brightness(fake) == pytest.approx([50, 100])
    assert fake.logged("error") == ["/camera: camera 0 gives no more images; was it unplugged?"]
    assert codes == [1]


@pytest.mark.parametrize("composed", ["false", "true"])
def test_the_basics_with_a_webcam_need_no_vehicle(composed):
    nodes, parameters = launch_files.expand(
        CONFIG.parent / "launch" / "basics.launch", webcam="0", composed=composed
    )
    assert parameters["/camera/device"] == "0"
    assert not {"/simulator", "/visualizer"} & set(nodes)
    assert "basics.rviz" in nodes["/rviz"].args
    assert ("/composed" in nodes) == (composed == "true")
    assert ("/camera" in nodes) == (composed == "false")
