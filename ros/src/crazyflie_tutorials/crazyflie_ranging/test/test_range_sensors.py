"""Sensor files, and what simulated sensors measure."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import rospkg
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from crazyflie_model.angles import quaternion_from_rpy, rotate
from crazyflie_ranging import range_sensors
from crazyflie_ranging.range_sensors import DIRECTIONS, Ranger, cone
from crazyflie_utils import ParameterError
from crazyflie_utils.testing.random_input import (
    assert_refused,
    assert_taken_or_refused,
    with_an_odd_word,
)
from crazyflie_world.shapes import Ball, Box
from crazyflie_world.world import Floor, World

CONFIG = Path(rospkg.RosPack().get_path("crazyflie_ranging")) / "config"

ENTRY = """\
  - type: laser
    frame_id: cf/front
    name: front
    direction: front
    min_range: 0.05
    max_range: 2.0
    spread_angle: 0.4
    desired_frequency: 20
"""
GOOD = "sensors:\n" + ENTRY + ENTRY.replace("front", "back")

WORLD = World(
    floor=Floor(size=(10.0, 10.0)),
    objects=(
        Box(name="wall", centre=(2.1, 0.0, 1.0), extent=(0.2, 4.0, 2.0)),
        Ball(name="ball", centre=(0.0, 1.2, 1.0), radius=0.2),
    ),
)


@pytest.fixture
def write(tmp_path):
    def write(text):
        file = tmp_path / "sensors.yaml"
        file.write_text(text)
        return file

    return write


def sensors(write, directions, **changes):
    entry = ENTRY
    for key, value in changes.items():
        entry = re.sub(f"    {key}:.*\n", "", entry) + f"    {key}: {value}\n"
    text = "".join(entry.replace("front", direction) for direction in directions)
    return range_sensors.load(write(f"sensors:\n{text}"))


def test_the_deck():
    deck = range_sensors.load(CONFIG / "multiranger.yaml")
    assert [each.direction for each in deck] == ["front", "back", "left", "right", "up"]
    assert [each.log_variable for each in deck] == [f"range.{each.name}" for each in deck]


@pytest.mark.parametrize(
    ("old", "new", "line", "expected"),
    [
        ("type: laser", "type: sonar", 2, "is 'sonar'; expected one of laser, ultrasonic"),
        ("frame_id: cf/front", "frame_id: 7", 3, "expected the name of a tf frame"),
        ("name: front", "name: a b", 4, "expected the name of a topic"),
        ("direction: front", "direction: ahead", 5, "expected one of front, back, left"),
        ("min_range: 0.05", "min_range: -0.05", 6, "is -0.05; expected a finite number >= 0 (m)"),
        ("min_range: 0.05", "min_range: 3", 2, "min_range is 3; expected < max_range, 2 (m)"),
        ("max_range: 2.0", "max_range: .inf", 7, "max_range"),
        ("spread_angle: 0.4", "spread_angle: 4", 8, "<= 3.14159 (rad)"),
        ("desired_frequency: 20", "desired_frequency: 0", 9, "> 0 and <= 100 (Hz)"),
        ("    desired_frequency: 20\n", "", 2, "desired_frequency"),
        ("desired_frequency: 20", "desired_frequency: 20\n    port: 1", 10, "port is not known"),
        ("name: back", "name: front", 12, "'front', which is there in line 4"),
        ("frame_id: cf/back", "frame_id: cf/front", 11, "'cf/front', which is there in line 3"),
        ("sensors:", "nxt_robot: 1\nsensors:", 1, "nxt_robot is not known; expected sensors"),
    ],
)
def test_bad_files(write, old, new, line, expected):
    assert old in GOOD
    file = write(GOOD.replace(old, new, 1))
    assert_refused(range_sensors.load, file, line, expected)


@pytest.mark.parametrize("text", ["", "sensors: []\n", "sensors: 3\n", "other: []\n"])
def test_no_sensors(write, text):
    with pytest.raises(ParameterError, match=r"sensors\.yaml"):
        range_sensors.load(write(text))


@given(st.floats(0.0, math.pi), st.integers(1, 60))
def test_a_cone_has_its_width_and_an_axis(spread, count):
    rays = cone(spread, count)
    assert rays.shape == (count, 3)
    assert np.linalg.norm(rays, axis=1) == pytest.approx(1.0)
    assert rays[0] == pytest.approx([1.0, 0.0, 0.0])
    angles = np.arccos(np.clip(rays[:, 0], -1.0, 1.0))
    assert angles.max() == pytest.approx(spread / 2.0 if count > 1 else 0.0, abs=1e-6)


def test_cones_are_filled_to_all_sides():
    rays = cone(0.4, 40)
    assert np.abs(rays[:, 1:].mean(axis=0)).max() < 0.02


@pytest.mark.parametrize(
    ("direction", "axis"),
    zip(
        ("front", "back", "left", "right", "up", "down"),
        ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)),
        strict=True,
    ),
)
def test_directions(direction, axis):
    attitude = quaternion_from_rpy(*DIRECTIONS[direction])
    assert rotate(attitude, (1.0, 0.0, 0.0)) == pytest.approx(axis)


def measured(chosen, position=(0.0, 0.0, 1.0), rpy=(0.0, 0.0, 0.0)):
    ranger = Ranger(chosen, np.random.default_rng(1))
    return ranger.measure(WORLD, position, quaternion_from_rpy(*rpy))


def test_distances_to_all_sides(write):
    chosen = sensors(write, ("front", "back", "left", "right", "up", "down"))
    assert measured(chosen) == pytest.approx(
        [2.0, math.inf, 1.0, math.inf, math.inf, 1.0], abs=1e-9
    )


def test_they_turn_with_the_vehicle(write):
    (sensor,) = sensors(write, ("left",))
    assert measured([sensor], rpy=(0.0, 0.0, -math.pi / 2.0)) == pytest.approx([2.0])
    # Rolled to the right it looks over the ball.
    assert measured([sensor], rpy=(0.6, 0.0, 0.0)) == [math.inf]


def test_what_is_beside_the_axis_is_seen_too(write):
    narrow = sensors(write, ("left",), spread_angle=0.0)
    wide = sensors(write, ("left",))
    place = (0.3, 0.0, 1.0)
    assert measured(narrow, place) == [math.inf]
    assert measured(wide, place)[0] == pytest.approx(1.05, abs=0.05)


def test_limits_and_place(write):
    (sensor,) = sensors(write, ("front",), position="[0.1, 0, 0]")
    assert measured([sensor], (0.5, 0.0, 1.0)) == pytest.approx([1.4])
    assert measured([sensor], (1.88, 0.0, 1.0)) == [-math.inf]
    assert measured([sensor], (1.8, 0.0, 1.0)) == pytest.approx([0.1])
    assert measured([sensor], (-0.2, 0.0, 1.0)) == [math.inf]


def test_noise(write):
    (sensor,) = sensors(write, ("front",), noise=0.02)
    ranger = Ranger([sensor], np.random.default_rng(1))
    readings = [ranger.measure(WORLD, (1.0, 0, 1), (0, 0, 0, 1))[0] for _ in range(500)]
    assert np.mean(readings) == pytest.approx(1.0, abs=0.005)
    assert np.std(readings) == pytest.approx(0.02, rel=0.15)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=with_an_odd_word(GOOD))
def test_any_value_anywhere_is_taken_or_refused(write, text):
    assert_taken_or_refused(range_sensors.load, write(text))
