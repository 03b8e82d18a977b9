"""Faces that are hidden, first the square, then the node with a picture of a face."""

import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import Image

from crazyflie_utils.testing import FakeProcess
from crazyflie_vision.images import to_array, to_message
from crazyflie_vision.trackers import FaceDetector, Target
from hide_faces.hide import hide
from hide_faces.hide_faces_node import HideFacesNode


@pytest.fixture
def noise():
    """Return an image in which every pixel differs from its neighbours."""
    return np.random.default_rng(1).integers(0, 256, (60, 80, 3), dtype=np.uint8)


def test_blurs_the_square_and_nothing_else(noise):
    before = noise.copy()
    hidden = hide(noise, Target(40.0, 30.0, 10.0), 9)
    assert (noise == before).all()
    changed = np.argwhere((hidden != noise).any(axis=2))
    assert changed.min(axis=0).tolist() == [20, 30]
    assert changed.max(axis=0).tolist() == [39, 49]
    assert hidden[22:38, 32:48].std() < 0.5 * noise[22:38, 32:48].std()


def test_a_face_at_the_border_is_cut(noise):
    hidden = hide(noise, Target(2.0, 58.0, 10.0), 9)
    changed = np.argwhere((hidden != noise).any(axis=2))
    assert changed.max(axis=0).tolist() == [59, 11]


def test_no_face_is_found_in_what_the_node_publishes():
    package = subprocess.run(
        ["rospack", "find", "crazyflie_vision"], capture_output=True, text=True, check=True
    ).stdout.strip()
    picture = cv2.imread(str(Path(package) / "config" / "face.jpg"))
    assert FaceDetector().find(picture) is not None
    process = FakeProcess()
    assert process.launch(HideFacesNode(), "/hide_faces")
    process.publish("/camera/image_raw", to_message(picture, Image().header))
    hidden = to_array(process.published("/hide_faces/image")[-1])
    assert FaceDetector().find(hidden) is None
