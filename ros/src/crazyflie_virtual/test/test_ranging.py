"""Ranging sensors."""

import math

import pytest
from virtual_bench import Bench

from crazyflie_utils import ParameterError
from crazyflie_virtual.body import NOTHING, Physics, RangingSensors
from crazyflie_virtual.log import log_variables

SIDES = ("front", "back", "left", "right", "up")


class At:
    """A body at a height, m, with an attitude."""

    world = None

    def __init__(self, height, quaternion=(0.0, 0.0, 0.0, 1.0)):
        self.position = (0.0, 0.0, height)
        self.quaternion = quaternion


def test_on_the_ground_and_in_flight():
    bench = Bench(multiranger=True)
    values = {v.name: v.read for v in log_variables() if v.group == "range"}
    assert values["zrange"](bench.firmware) == 0
    bench.take_off(1.0)
    assert values["zrange"](bench.firmware) == pytest.approx(1000.0 * bench.height, abs=5)
    assert {values[side](bench.firmware) for side in SIDES} == {NOTHING}


def test_the_ground_is_beside_a_vehicle_that_is_tilted():
    half = math.radians(60.0) / 2.0
    # Nose down.
    tilted = RangingSensors(At(1.0, (0.0, math.sin(half), 0.0, math.cos(half))), True, True)
    assert tilted.distance("front") == round(1000.0 / math.sin(math.radians(60.0)))
    assert tilted.distance("zrange") == 2000
    assert {tilted.distance(side) for side in ("back", "up", "left", "right")} == {NOTHING}


def test_reach():
    assert RangingSensors(At(3.99), True, True).distance("zrange") == 3990
    assert RangingSensors(At(4.01), True, True).distance("zrange") == NOTHING


def test_without_decks():
    without = RangingSensors(Physics(), False, False)
    assert [without.distance(side) for side in (*SIDES, "zrange")] == [0] * 6


WORLD = """\
floor: {size: [4, 4]}
objects:
  - {type: box, name: box, centre: [1.5, 0, 1], size: [1, 1, 1]}
"""


def test_what_is_in_a_world(tmp_path):
    file = tmp_path / "room.yaml"
    file.write_text(WORLD)
    bench = Bench(multiranger=True, world=str(file))
    bench.take_off(1.0)
    ranging = bench.firmware.ranging
    x, _, height = bench.physics.position
    assert ranging.distance("front") == pytest.approx(1000.0 * (1.0 - x), abs=20)
    assert ranging.distance("zrange") == pytest.approx(1000.0 * height, abs=20)
    assert {ranging.distance(side) for side in ("back", "left", "right", "up")} == {NOTHING}


def test_a_bad_world_is_named(tmp_path):
    file = tmp_path / "room.yaml"
    file.write_text(WORLD.replace("type: box", "type: cone"))
    with pytest.raises(ParameterError, match=r"room\.yaml:3: .*'cone'"):
        Bench(multiranger=True, world=str(file))
