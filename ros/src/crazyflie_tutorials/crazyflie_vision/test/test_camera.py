"""The camera's numbers, and what is said about a bad file."""

import math
from pathlib import Path

import numpy as np
import pytest
import rospkg

from crazyflie_utils import ParameterError
from crazyflie_vision.camera import MountParameters, Pinhole, load, optical_pose

CONFIG = Path(rospkg.RosPack().get_path("crazyflie_vision")) / "config"


def test_the_edges_of_the_image_are_the_field_of_view_apart():
    camera = Pinhole.with_fov(320, 240, 90.0)
    assert camera.focal_length == pytest.approx(160.0)
    assert camera.centre == (159.5, 119.5)
    edge = camera.matrix @ [math.tan(math.radians(45.0)), 0.0, 1.0]
    assert edge == pytest.approx([319.5, 119.5, 1.0])


def test_axes_of_the_optical_frame():
    pose = optical_pose(MountParameters(x=0.1, pitch=30.0, yaw=90.0))
    right, down, ahead = pose.rotation.T
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    # To the left, and 30 degrees down.
    assert ahead == pytest.approx([0.0, c, -s])
    assert right == pytest.approx([1.0, 0.0, 0.0])
    assert down == pytest.approx([0.0, -s, -c])
    assert np.cross(right, down) == pytest.approx(ahead)
    assert pose.position == pytest.approx([0.1, 0.0, 0.01])


def test_the_file_that_is_flown_with():
    camera = load(CONFIG / "camera.yaml")
    assert (camera.width, camera.height, camera.rate) == (320, 240, 30.0)


def test_all_of_it_has_a_default(tmp_path):
    file = tmp_path / "camera.yaml"
    file.write_text("rate: 10\n")
    assert load(file).mount.x == 0.03


@pytest.mark.parametrize(
    ("text", "line", "expected"),
    [
        ("width: 320\nheight: 0\n", 2, "expected an integer from 16 to 4096"),
        ("width: 320\nfov: 180\n", 2, "expected a finite number >= 10 and <= 150 (deg)"),
        ("rate: -30\n", 1, "expected a finite number > 0 and <= 200 (Hz)"),
        ("rate: 30\n\nnoise: -1\n", 3, "expected a finite number >= 0 and <= 100"),
        ("latency: soon\n", 1, "expected a finite number >= 0 (s)"),
        ("mount:\n  x: 0.0\n  pitch: 100\n", 3, "expected a finite number >= -90 and <= 90 (deg)"),
        ("rate: 30\nshutter: 2\n", 2, "shutter is not known; expected one of"),
        ("rate: 30\nrate: 20\n", 2, "occurs twice"),
        ("rate: [30\n", 2, "is not valid YAML"),
    ],
)
def test_bad_files(tmp_path, text, line, expected):
    file = tmp_path / "camera.yaml"
    file.write_text(text)
    with pytest.raises(ParameterError) as error:
        load(file)
    assert f"{file}:{line}" in str(error.value)
    assert expected in str(error.value)


def test_no_file():
    with pytest.raises(ParameterError, match=r"/nowhere/camera\.yaml: cannot be read"):
        load("/nowhere/camera.yaml")
