"""World files: what is in them, and what is said about bad ones."""

from pathlib import Path

import pytest
import rospkg
from hypothesis import HealthCheck, given, settings

from crazyflie_utils import ParameterError
from crazyflie_utils.testing.random_input import (
    assert_refused,
    assert_taken_or_refused,
    with_an_odd_word,
)
from crazyflie_world import world_file
from crazyflie_world.shapes import Ball, Box, Circle, Cylinder, Waypoints
from crazyflie_world.world import Floor
from crazyflie_world.world_file import WORLD_FILE

LAB = Path(rospkg.RosPack().get_path("crazyflie_world")) / "config" / "lab.yaml"

GOOD = """\
floor: {size: [4, 3]}
objects:
  - {type: box, name: crate, centre: [1, 0, 0.5], size: [0.2, 0.3, 1.0], yaw: 0.5}
  - {type: cylinder, name: pillar, centre: [0, 1, 1], radius: 0.2, height: 2, colour: [1, 0, 0]}
  - {type: wall, name: side, from: [-2, 1.5], to: [2, 1.5]}
  - type: ball
    name: ball
    radius: 0.1
    path: {type: waypoints, points: [[0, 1, 0, 1], [2, 2, 0, 1], [4, 1, 0, 1]]}
  - type: ball
    name: other
    radius: 0.1
    path: {type: circle, centre: [0, 0, 1], radius: 0.5, period: 9}
"""


@pytest.fixture
def write(tmp_path):
    def write(text):
        file = tmp_path / "room.yaml"
        file.write_text(text)
        return file

    return write


def test_files_are_found_from_home(write, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "tag.png").write_bytes(b"")
    write(
        "floor: {size: [4, 3]}\nobjects:\n"
        "  - {type: box, name: tag, centre: [0, 0, 1], size: [0.1, 1, 1], picture: ~/tag.png}\n"
    )
    assert WORLD_FILE("~/room.yaml")["tag"].picture == str(tmp_path / "tag.png")
    with pytest.raises(ParameterError, match=f"looked for {tmp_path}/none.yaml"):
        world_file.load("~/none.yaml")


def test_objects_may_merge_others(write):
    world = world_file.load(
        write("""\
floor: {size: [4, 3]}
boxes: &box {type: box, size: [2e-1, 0.3, 1], yaw: 5e-1}
objects:
  - {<<: *box, name: first, centre: [1, 0, 0.5]}
  - {<<: *box, name: second, centre: [2, 0, 0.5], yaw: 0}
""")
    )
    assert world["first"].extent == world["second"].extent == (0.2, 0.3, 1.0)
    assert (world["first"].yaw, world["second"].yaw) == (0.5, 0.0)


def test_what_is_in_it(write):
    world = world_file.load(write(GOOD))
    assert world.frame == "world"
    assert world.floor == Floor(size=(4.0, 3.0))
    assert world["crate"] == Box(
        name="crate", centre=(1.0, 0.0, 0.5), extent=(0.2, 0.3, 1.0), yaw=0.5
    )
    assert world["pillar"] == Cylinder(
        name="pillar", centre=(0.0, 1.0, 1.0), radius=0.2, height=2.0, colour=(1.0, 0.0, 0.0)
    )
    assert world["side"].size == pytest.approx((4.0, 0.1, 2.5))
    ball, other = world["ball"], world["other"]
    assert isinstance(ball, Ball)
    assert isinstance(ball.path, Waypoints)
    assert isinstance(other.path, Circle)
    assert (ball.centre, other.centre) == ((1.0, 0.0, 1.0), (0.5, 0.0, 1.0))


def test_the_lab():
    world = world_file.load(LAB)
    assert [each.name for each in world.moving] == ["ball"]
    distances, indices = world.cast((0.0, 0.0, 1.0), [(1, 0, 0), (0, 1, 0), (0, 0, -1)])
    assert distances == pytest.approx([1.08, 1.95, 1.0])
    assert [world.solids[k].name for k in indices] == ["ball", "north", "floor"]


@pytest.mark.parametrize(
    ("old", "new", "line", "expected"),
    [
        ("type: box", "type: cone", 3, "objects[0]/type is 'cone'; expected one of box, cylinder"),
        ("type: box", "type: [box]", 3, "is ['box']; expected one of box, cylinder, ball, wall"),
        ("type: box, ", "", 3, "objects[0] has no type"),
        ("0.2, 0.3, 1.0", "0.2, -0.3, 1.0", 3, "objects[0]/size"),
        ("0.2, 0.3, 1.0", "0.2, 0.3", 3, "objects[0]/size"),
        ("height: 2", "height: .nan", 4, "is nan; expected a finite number > 0 (m)"),
        ("[1, 0, 0]", "[1, 0, 2]", 4, ">= 0 and <= 1"),
        ("radius: 0.2", "radios: 0.2", 4, "objects[1]/radios is not known"),
        ("name: pillar", "name: crate", 4, "is 'crate', which is the name of the object in line 3"),
        ("name: pillar", "name: floor", 4, "which is the name of the floor"),
        ("name: pillar", "name: world", 4, "which is the name of the frame"),
        ("name: pillar", "name: a/b", 4, "expected a name of letters, digits and underscores"),
        ("to: [2, 1.5]", "to: [-2, 1.5]", 5, "expected two points"),
        ("type: waypoints", "type: spiral", 9, "'spiral'; expected one of circle, waypoints"),
        ("[2, 2, 0, 1]", "[5, 2, 0, 1]", 9, "expected each larger than the last, from 0 (s)"),
        ("[4, 1, 0, 1]", "[4, 1, 0, 2]", 9, "expected the first, [1.0, 0.0, 1.0] (m)"),
        ("period: 9", "period: 0", 13, "is 0; expected a finite number >= 0.0001 (s)"),
        ("centre: [1, 0, 0.5], ", "", 3, "both a centre and a path"),
        ("name: other", "name: other\n    centre: [0, 0, 1]", 10, "both a centre and a path"),
        ("size: [4, 3]", "size: [4, 0]", 1, "floor/size"),
        ("yaw: 0.5", "picture: none.png", 3, "objects[0]/picture is 'none.png'; expected a file"),
        ("yaw: 0.5", f"picture: {'x' * 1000}", 3, "objects[0]/picture is 'xxxxx"),
        ("yaw: 0.5", 'picture: "a\\0b"', 3, "objects[0]/picture is 'a\\x00b'; expected a file"),
        ("floor: {size: [4, 3]}", "floor: {size: [4, 3], texture: lawn}", 1, "one of plain"),
        ("floor:", "ceiling:", 1, "ceiling is not known"),
        ("floor: {size: [4, 3]}", "frame: world", 1, "floor/size"),
    ],
)  # fmt: skip
def test_bad_files(write, old, new, line, expected):
    assert old in GOOD
    file = write(GOOD.replace(old, new, 1))
    assert_refused(world_file.load, file, line, expected)


def test_a_picture_lies_beside_the_file(write, tmp_path):
    (tmp_path / "face.png").touch()
    world = world_file.load(write(GOOD.replace("yaw: 0.5", "picture: face.png")))
    assert world["crate"].picture == str(tmp_path / "face.png")


def test_everything_wrong_is_reported_at_once(write):
    bad = GOOD.replace("type: box", "type: cone").replace("radius: 0.2", "radius: -1")
    with pytest.raises(ParameterError) as error:
        world_file.load(write(bad))
    assert len(error.value.complaints) == 2


@pytest.mark.parametrize("text", ["", "3", "floor: [", "floor: {size: [4, 3]}\nobjects: 7\n"])
def test_no_world_at_all(write, text):
    with pytest.raises(ParameterError, match=r"room\.yaml"):
        world_file.load(write(text))


def test_a_missing_file():
    with pytest.raises(ParameterError, match=r"^/nowhere/room\.yaml: cannot be read"):
        world_file.load("/nowhere/room.yaml")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=with_an_odd_word(GOOD))
def test_any_value_anywhere_is_taken_or_refused(write, text):
    assert_taken_or_refused(world_file.load, write(text))
