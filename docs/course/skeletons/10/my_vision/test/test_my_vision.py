"""The filters and the ball finder."""

import cv2
import numpy as np
import pytest
from std_msgs.msg import Header

from crazyflie_utils.testing import FakeProcess
from crazyflie_vision.images import to_message
from my_vision import filters
from my_vision.ball_node import BallNode
from my_vision.trackers import ColourBounds, draw, find

ORANGE = (20, 110, 230)
"""Blue, green, red."""


@pytest.fixture
def picture():
    """Return a grey image with an orange ball at (200, 80) of radius 20 pixels, and a small one."""
    image = np.full((240, 320, 3), 90, dtype=np.uint8)
    cv2.circle(image, (200, 80), 20, ORANGE, -1)
    cv2.circle(image, (40, 200), 4, ORANGE, -1)
    return image


def test_step_1_grey_weighs_green_most():
    image = np.array([[(255, 0, 0), (0, 255, 0), (0, 0, 255)]], dtype=np.uint8)
    assert filters.grey(image).tolist() == [[29, 150, 76]]


def test_step_1_blur_keeps_the_mean_and_takes_away_noise():
    noise = np.random.default_rng(1).integers(0, 256, (60, 60, 3)).astype(np.uint8)
    blurred = filters.blur(noise, 9)
    assert blurred.shape == noise.shape
    assert blurred.mean() == pytest.approx(noise.mean(), abs=2.0)
    assert blurred.std() < 0.3 * noise.std()


def test_step_1_blur_counts_near_neighbours_more():
    image = np.zeros((9, 9), dtype=np.uint8)
    image[4, 4] = 255
    middle, near, far = filters.blur(image, 5)[4, 4:7].astype(int)
    assert middle > near > far > 0


def test_step_1_edges_are_where_brightness_changes(picture):
    found = filters.edges(picture, low=40.0, high=120.0, size=3)
    assert set(np.unique(found)) == {0, 255}
    ys, xs = np.nonzero(found[:, 150:])
    assert np.hypot(xs + 150 - 200, ys - 80) == pytest.approx(20.0, abs=3.0)


def test_step_1_threshold_is_black_and_white():
    image = np.array([[(100, 100, 100), (101, 101, 101)]], dtype=np.uint8)
    assert filters.threshold(image, 100).tolist() == [[0, 255]]


def test_step_2_the_mask_is_where_the_colour_is(picture):
    mask = ColourBounds.from_mapping({}).mask(picture)
    assert (mask[80, 200], mask[200, 40], mask[10, 10]) == (255, 255, 0)


def test_step_2_bounds_may_go_through_red():
    image = np.array([[(0, 0, 255), (30, 0, 255), (0, 255, 0)]], dtype=np.uint8)
    bounds = ColourBounds.from_mapping({"hue_lower": 170, "hue_upper": 5})
    assert bounds.mask(image).tolist() == [[255, 255, 0]]


def test_step_3_finds_the_largest_ball_by_its_moments(picture):
    target = find(picture, ColourBounds.from_mapping({}), 30.0)
    assert (target.x, target.y) == pytest.approx((200.0, 80.0), abs=0.5)
    assert target.radius == pytest.approx(20.0, abs=1.0)


def test_step_3_finds_nothing_where_nothing_is(picture):
    picture[picture[:, :, 2] > 200] = 90
    assert find(picture, ColourBounds.from_mapping({}), 30.0) is None


def test_step_4_marks_the_centre(picture):
    target = find(picture, ColourBounds.from_mapping({}), 30.0)
    drawn = draw(picture, target)
    assert (drawn[80, 196:205] == (0, 255, 0)).all(axis=1).sum() >= 3
    assert (picture[80, 200] == ORANGE).all()


@pytest.fixture
def process(picture):
    """Return a process with the node in it, which has seen the picture once."""
    fake = FakeProcess()
    assert fake.launch(BallNode(), "/tracker")
    fake.publish("/camera/image_raw", to_message(picture, Header()))
    return fake


def test_step_5_the_bounds_change_while_it_runs(process, picture):
    process.reconfigure("/tracker", hue_lower=140, hue_upper=160)
    count = len(process.published("/target"))
    process.publish("/camera/image_raw", to_message(picture, Header()))
    assert count == 1
    assert len(process.published("/target")) == count


def test_step_6_publishes_the_ball(process):
    [target] = process.published("/target")
    assert (target.point.x, target.point.y) == pytest.approx((200.0, 80.0), abs=0.5)
    assert target.point.z == pytest.approx(20.0, abs=1.0)
