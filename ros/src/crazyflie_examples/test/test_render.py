"""Pictures of the screen: what is read from a window dump, and what is found on it."""

import struct

import numpy as np
import pytest

from crazyflie_examples.render_rviz import (
    background_of,
    crop_to_scene,
    material_of,
    pixels_of,
)
from crazyflie_examples.virtual_display import DisplayError, decode_xwd

BACKGROUND = (10, 20, 30)
ORANGE = (1.0, 0.35, 0.05)


def dump(picture, byte_order=0, padding=0, colours=2, version=7, bits=32):
    """Return a window dump as X11/XWDFile.h describes it, written independently."""
    height, width, _ = picture.shape
    words = [0] * 25
    words[0:6] = [100 + 4, version, 2, 24, width, height]
    words[7], words[11], words[12], words[19] = byte_order, bits, 4 * width + padding, colours
    rows = b""
    for row in picture.tolist():
        for red, green, blue in row:
            value = (red << 16) | (green << 8) | blue
            rows += struct.pack("<I" if byte_order == 0 else ">I", value)
        rows += b"\xff" * padding
    return struct.pack(">25I", *words) + b"Xvfb" + b"\xee" * (12 * colours) + rows


@pytest.fixture
def picture():
    """Return noise, shape (5, 7, 3)."""
    return np.random.default_rng(1).integers(0, 256, size=(5, 7, 3), dtype=np.uint8)


@pytest.mark.parametrize("byte_order", [0, 1])
@pytest.mark.parametrize("padding", [0, 4])
@pytest.mark.parametrize("colours", [0, 256])
def test_decodes_window_dumps(picture, byte_order, padding, colours):
    decoded = decode_xwd(dump(picture, byte_order, padding, colours))
    np.testing.assert_array_equal(decoded, picture)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [({"version": 6}, "version 6"), ({"bits": 16}, "16 bits")],
)
def test_refuses_other_dumps(picture, changes, complaint):
    with pytest.raises(DisplayError, match=complaint):
        decode_xwd(dump(picture, **changes))


def test_refuses_half_a_dump(picture):
    with pytest.raises(DisplayError, match="cut off"):
        decode_xwd(dump(picture)[:-1])
    with pytest.raises(DisplayError, match="no header"):
        decode_xwd(b"")


def test_crops_to_the_scene():
    screen = np.full((60, 80, 3), 200, dtype=np.uint8)
    screen[10:50, 20:70] = BACKGROUND
    screen[25:35, 30:40] = (255, 0, 0)
    scene = crop_to_scene(screen, BACKGROUND)
    assert scene.shape == (40, 50, 3)
    np.testing.assert_array_equal(scene, screen[10:50, 20:70])
    assert crop_to_scene(screen, (1, 2, 3)).size == 0


@pytest.mark.parametrize("light", [0.4, 0.7, 1.0])
def test_finds_a_colour_in_any_light(light):
    picture = np.full((20, 20, 3), 240, dtype=np.uint8)
    picture[5:8, 5:10] = np.array(ORANGE) * 255 * light
    picture[12, :] = (255, 0, 0)
    picture[15, :] = (2, 1, 0)
    assert pixels_of(picture, ORANGE) == 15


def test_an_empty_picture_has_no_colour():
    assert pixels_of(np.zeros((0, 0, 3), dtype=np.uint8), ORANGE) == 0


def test_reads_colours_where_they_are_set(tmp_path):
    configuration = tmp_path / "x.rviz"
    configuration.write_text(
        "Visualization Manager:\n  Global Options:\n    Background Color: 10; 20; 30\n"
    )
    assert background_of(configuration) == [10, 20, 30]
    model = tmp_path / "x.urdf"
    model.write_text(
        '<robot name="x"><material name="front"><color rgba="1 0.35 0.05 1"/></material></robot>'
    )
    assert material_of(model, "front") == list(ORANGE)
