"""Pictures of the screen: how they are taken, and what is found on them."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from crazyflie_dev.render_demo import HEIGHT, WIDTH, animation, projected, timed
from crazyflie_dev.render_rviz import (
    DisplayError,
    background_of,
    crop_to_scene,
    main,
    material_of,
    pixels_of,
    screenshot,
    virtual_display,
)

BACKGROUND = (10, 20, 30)
ORANGE = (1.0, 0.35, 0.05)


def test_a_screenshot_is_as_large_as_the_display():
    with virtual_display(320, 200) as display:
        picture = screenshot(display)
        assert (picture.shape, picture.dtype) == ((200, 320, 3), np.uint8)
    with pytest.raises(DisplayError, match=f"no picture of display {display}"):
        screenshot(display)


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


LINES = [(0.1, "launching it"), (9.0, "rosservice call /takeoff"), (13.0, "landed <in> peace")]


def test_the_start_of_a_launch_is_shortened_and_the_flight_is_not():
    (launch, _), (takeoff, _), (end, text) = timed(LINES)
    assert launch == 0.0
    assert 0.0 < takeoff < 2.0
    assert (end - takeoff, text) == (pytest.approx(4.0), "landed <in> peace")


def test_a_demo_that_did_not_take_off_has_no_picture():
    with pytest.raises(ValueError, match="not taken off"):
        timed(LINES[:1])


def test_the_vehicle_of_the_animation_flies_and_each_line_comes_in_its_time():
    flight = np.array([[0.0, 0.1, 0.2, 0.0], [2.0, 0.1, 0.2, 1.0], [4.0, 0.1, 0.2, 0.0]])
    picture = ElementTree.fromstring(animation(timed(LINES), flight))
    prompt, *texts = picture.findall(".//{*}text")
    assert prompt.text == "$ ./run demo"
    assert [text.text for text in texts] == [text for _, text in LINES]
    shown = [animate for text in texts for animate in text]
    starts = [float(each.get("keyTimes").split(";")[1]) for each in shown]
    assert starts == sorted(starts)
    assert len(starts) == 2
    *_, vehicle = picture.findall(".//{*}animateTransform")
    places = np.array([place.split(",") for place in vehicle.get("values").split(";")], dtype=float)
    ground, top = projected(np.array([[0.1, 0.2, 0.0], [0.1, 0.2, 1.0]]))
    np.testing.assert_allclose(places[[0, -1]], [ground, ground], atol=0.6)
    assert places[:, 1].min() == pytest.approx(top[1], abs=4.0)
    assert ((places > 0.0) & (places < (WIDTH, HEIGHT))).all()
    assert not re.search("nan|inf", vehicle.get("values"))


def test_what_cannot_be_launched_is_named(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["render", "no_file"])
    assert main() == 1
    assert "no picture: roslaunch has not started anything:" in capsys.readouterr().err
