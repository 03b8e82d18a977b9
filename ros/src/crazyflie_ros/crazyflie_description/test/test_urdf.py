"""The models: read by urdfdom's own parser, and measured."""

import math
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from crazyflie_model.quadrotor import CRAZYFLIE

URDF = Path(__file__).resolve().parent.parent / "urdf"

# Motor to motor across a diagonal, height, mass; metres and kilogrammes.
MODELS = {
    "crazyflie": (0.090, 0.022, 0.019),
    "crazyflie2": (2.0 * CRAZYFLIE.arm, 0.029, CRAZYFLIE.mass),
}

# Sign of x (forward) and y (left) of each motor, in the firmware's numbering.
CORNERS = {1: (1, -1), 2: (-1, -1), 3: (-1, 1), 4: (1, 1)}

pytestmark = pytest.mark.parametrize("model", MODELS)


def robot(model):
    return ElementTree.parse(URDF / f"{model}.urdf").getroot()


def numbers(element, attribute):
    return np.array(element.get(attribute, "0 0 0").split(), dtype=float)


def positions(model, prefix):
    """Return number -> position (3,) of the visuals that are called prefix_number."""
    return {
        k: numbers(robot(model).find(f"link/visual[@name='{prefix}_{k}']/origin"), "xyz")
        for k in CORNERS
    }


def bounds(model):
    """Return the lowest and the highest z of everything that stands upright."""
    lowest, highest = math.inf, -math.inf
    for visual in robot(model).iter("visual"):
        origin = visual.find("origin")
        z, (roll, pitch, _) = numbers(origin, "xyz")[2], numbers(origin, "rpy")
        if roll or pitch:
            continue
        shape = visual.find("geometry")[0]
        size = {
            "box": lambda s: numbers(s, "size")[2],
            "cylinder": lambda s: float(s.get("length")),
            "sphere": lambda s: 2.0 * float(s.get("radius")),
        }[shape.tag](shape)
        lowest, highest = min(lowest, z - size / 2.0), max(highest, z + size / 2.0)
    return lowest, highest


def test_urdfdom_reads_it(model):
    command = ["check_urdf", str(URDF / f"{model}.urdf")]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "Successfully Parsed XML" in result.stdout
    assert "root Link: base_link has 0 child(ren)" in result.stdout
    assert "rror" not in result.stdout + result.stderr


def test_motors_are_as_far_apart_as_they_should_be(model):
    motors = positions(model, "motor")
    diagonal = MODELS[model][0]
    assert math.dist(motors[1], motors[3]) == pytest.approx(diagonal, abs=1e-5)
    assert math.dist(motors[2], motors[4]) == pytest.approx(diagonal, abs=1e-5)
    side = diagonal / math.sqrt(2.0)
    assert math.dist(motors[1], motors[2]) == pytest.approx(side, abs=1e-5)
    assert math.dist(motors[1], motors[4]) == pytest.approx(side, abs=1e-5)


@pytest.mark.parametrize("part", ["motor", "hub", "disc"])
def test_motors_are_numbered_as_on_the_board(model, part):
    for k, (x, y, _) in positions(model, part).items():
        assert (math.copysign(1, x), math.copysign(1, y)) == CORNERS[k]


def test_front_propellers_have_another_colour(model):
    materials = {
        k: robot(model).find(f"link/visual[@name='hub_{k}']/material").get("name") for k in CORNERS
    }
    assert materials == {1: "front", 2: "back", 3: "back", 4: "front"}


def test_blades_turn_about_their_motors(model):
    hubs = positions(model, "hub")
    for k, hub in hubs.items():
        tips = [
            numbers(robot(model).find(f"link/visual[@name='blade_{k}{side}']/origin"), "xyz")
            for side in "ab"
        ]
        np.testing.assert_allclose(np.mean(tips, axis=0), hub, atol=2e-6)


def test_stands_on_the_ground(model):
    lowest, highest = bounds(model)
    assert lowest == pytest.approx(0.0, abs=1e-9)
    assert highest == pytest.approx(MODELS[model][1], abs=1e-9)


def test_every_material_is_defined(model):
    defined = [material.get("name") for material in robot(model).findall("material")]
    used = {material.get("name") for material in robot(model).findall("link/visual/material")}
    assert len(defined) == len(set(defined))
    assert set(defined) == used


def test_has_primitive_shapes_only(model):
    shapes = {geometry[0].tag for geometry in robot(model).iter("geometry")}
    assert shapes <= {"box", "cylinder", "sphere"}
    names = [visual.get("name") for visual in robot(model).iter("visual")]
    assert len(names) == len(set(names))


def test_mass_and_inertia_are_possible(model):
    inertial = robot(model).find("link/inertial")
    assert float(inertial.find("mass").get("value")) == MODELS[model][2]
    entries = {key: float(value) for key, value in inertial.find("inertia").attrib.items()}
    moments = sorted(entries[axis] for axis in ("ixx", "iyy", "izz"))
    assert moments[0] > 0.0
    # No mass distribution has a moment greater than the sum of the other two.
    assert moments[2] < moments[0] + moments[1]
    # And none of this size has more than a ring of all its mass around the tips.
    radius = float(robot(model).find("link/collision/geometry/cylinder").get("radius"))
    assert moments[2] < MODELS[model][2] * radius**2
