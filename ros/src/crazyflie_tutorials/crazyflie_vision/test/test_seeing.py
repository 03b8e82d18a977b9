"""Filters and trackers, on images whose content is known."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_camera import CONFIG

from crazyflie_vision import filters
from crazyflie_vision.camera import PixelNoise
from crazyflie_vision.trackers import ColourBounds, FaceDetector, Target, draw, find

ORANGE = (13, 102, 242)
ORANGES = ColourBounds()
FACE = cv2.imread(str(CONFIG / "face.jpg"))
DETECTOR = FaceDetector()


def image(colour=(130, 130, 130)):
    return np.full((240, 320, 3), colour, dtype=np.uint8)


def disc(x, y, radius, colour=ORANGE, on=None):
    made = image() if on is None else on
    return cv2.circle(made, (x, y), radius, colour, -1)


def test_grey_weighs_green_most():
    levels = [filters.grey(image(colour))[0, 0] for colour in np.eye(3, dtype=int) * 255]
    assert levels == [29, 150, 76]


def test_blur_smooths_and_keeps_the_mean():
    noisy = PixelNoise(320, 240, 20.0).add(image())
    blurred = filters.blur(noisy, 9)
    assert blurred.std() < noisy.std() / 3.0
    assert blurred.mean() == pytest.approx(noisy.mean(), abs=0.2)
    assert (filters.blur(noisy, 1) == noisy).all()


def test_edges_are_on_the_rim():
    rows, columns = np.nonzero(filters.edges(disc(150, 100, 40, (200, 50, 30)), 40.0, 120.0, 3))
    assert np.hypot(columns - 150, rows - 100) == pytest.approx(np.full(len(rows), 40.0), abs=2.0)
    assert len(rows) > 200
    assert not filters.edges(image(), 40.0, 120.0, 3).any()


def test_threshold():
    half = image((0, 0, 0))
    half[:, 160:] = 200
    assert (filters.threshold(half, 128) == np.where(np.arange(320) < 160, 0, 255)).all()
    assert not filters.threshold(half, 200).any()


@given(st.integers(30, 290), st.integers(30, 210), st.integers(4, 28))
def test_a_disc_is_found_in_noise(x, y, radius):
    scene = disc(20, 20, 15, (200, 80, 30))
    target = find(PixelNoise(320, 240, 5.0).add(disc(x, y, radius, on=scene)), ORANGES, 30.0)
    assert (target.x, target.y) == pytest.approx((x, y), abs=0.5)
    assert target.radius == pytest.approx(radius + 0.3, abs=0.7)


def test_the_larger_of_two():
    both = disc(240, 60, 12, on=disc(80, 150, 20))
    assert find(both, ORANGES, 30.0).x == pytest.approx(80, abs=0.5)


def test_a_range_of_hues_through_red():
    crimson = (60, 0, 230)
    through_red = ColourBounds(hue_lower=165, hue_upper=10)
    for colour in (crimson, ORANGE[:1] + (20, 240)):
        assert find(disc(160, 120, 20, colour), through_red, 30.0) is not None
    assert find(disc(160, 120, 20, (0, 200, 0)), through_red, 30.0) is None
    assert find(disc(160, 120, 20, crimson), ORANGES, 30.0) is None


@pytest.mark.parametrize("scene", [image(), image(ORANGE[::-1]), disc(160, 120, 2)])
def test_nothing_is_found_where_nothing_is(scene):
    assert find(scene, ORANGES, 30.0) is None


def test_a_disc_at_the_edge_has_its_visible_centre():
    target = find(disc(0, 120, 20), ORANGES, 30.0)
    assert 0.0 < target.x < 20.0


@pytest.mark.parametrize(("width", "x", "y"), [(90, 30, 60), (150, 150, 40)])
def test_a_face_is_found(width, x, y):
    scene = PixelNoise(320, 240, 2.0).add(image())
    height = round(width * FACE.shape[0] / FACE.shape[1])
    scene[y : y + height, x : x + width] = cv2.resize(
        FACE, (width, height), interpolation=cv2.INTER_AREA
    )
    target = DETECTOR.find(scene)
    # Nose and width in the picture.
    assert (target.x - x) / width == pytest.approx(0.5, abs=0.05)
    assert (target.y - y) / height == pytest.approx(0.49, abs=0.05)
    assert target.radius / width == pytest.approx(0.24, abs=0.03)


def test_no_face_in_noise():
    assert DETECTOR.find(PixelNoise(320, 240, 30.0).add(image())) is None


@pytest.mark.parametrize("content", [None, "", "<opencv_storage></opencv_storage>"])
def test_a_bad_cascade_is_named(tmp_path, content):
    file = tmp_path / "cascade.xml"
    if content is not None:
        file.write_text(content)
    with pytest.raises(OSError, match=r"cascade\.xml is not a cascade; .* opencv-data"):
        FaceDetector(str(file))


@given(st.floats(-50, 400), st.floats(-50, 400), st.floats(0.1, 300))
def test_what_is_drawn_leaves_the_image_alone(x, y, radius):
    scene = image()
    drawn = draw(scene, Target(x, y, radius))
    assert (scene == 130).all()
    assert (drawn != scene).any()
