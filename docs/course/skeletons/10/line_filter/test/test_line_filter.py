"""The lines, and the node that draws them."""

import math

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import Image

from crazyflie_utils.testing import FakeProcess
from crazyflie_vision.images import to_array, to_message
from line_filter.line_filter_node import LineFilterNode
from line_filter.lines import RED, find_lines


@pytest.fixture
def image():
    """Return a grey image with a white bar across it, from (20, 100) to (220, 40)."""
    picture = np.full((120, 240, 3), 60, dtype=np.uint8)
    cv2.line(picture, (20, 100), (220, 40), (255, 255, 255), thickness=8)
    return picture


def test_finds_the_edges_of_a_bar(image):
    lines = find_lines(image, shortest=100)
    assert lines
    for x0, y0, x1, y1 in lines:
        assert math.hypot(x1 - x0, y1 - y0) >= 100
        assert (y1 - y0) / (x1 - x0) == pytest.approx(-0.3, abs=0.05)


def test_short_lines_are_none(image):
    assert find_lines(image, shortest=230) == []


def test_nothing_is_found_where_nothing_is():
    assert find_lines(np.full((120, 240, 3), 60, dtype=np.uint8), shortest=20) == []


def test_the_node_draws_them(image):
    process = FakeProcess()
    assert process.launch(LineFilterNode(), "/lines")
    process.publish("/camera/image_raw", to_message(image, Image().header))
    drawn = to_array(process.published("/lines/image")[-1])
    assert (drawn == RED).all(axis=2).sum() > 100
