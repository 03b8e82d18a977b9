"""The nodes that publish ranges, on a fake process."""

import math
from pathlib import Path

import pytest
import rospkg
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import Range
from tf2_msgs.msg import TFMessage

from crazyflie_driver.msg import GenericLogData
from crazyflie_ranging.ranger_nodes import DeckRangerNode, SimulatedRangerNode
from crazyflie_utils.testing import FakeProcess

CONFIG = Path(rospkg.RosPack().get_path("crazyflie_ranging")) / "config"
SENSORS = str(CONFIG / "multiranger.yaml")
WORLD = str(CONFIG / "follow_object_world.yaml")

VARIABLES = [f"range.{side}" for side in ("front", "back", "left", "right", "up", "zrange")]


def transform(process, child, x, z=1.0):
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = "world"
    message.header.stamp = process.handle("/other").stamp()
    message.transform.translation.x = x
    message.transform.translation.z = z
    message.transform.rotation.w = 1.0
    return message


@pytest.fixture
def simulated():
    process = FakeProcess()
    parameters = {"world": WORLD, "sensors": SENSORS}
    assert process.launch(SimulatedRangerNode(), "/simulated_ranger", parameters)
    return process


def tell(process, x, box=1.0):
    transforms = [transform(process, "crazyflie", x), transform(process, "box", box)]
    process.publish("/tf", TFMessage(transforms))


def fly(process, duration, x=0.0, box=1.0):
    for _ in range(round(duration / 0.01)):
        tell(process, x, box)
        process.advance(0.01)


def test_simulated_ranges(simulated):
    fly(simulated, 1.0)
    messages = simulated.published("/range/front")
    assert len(messages) == pytest.approx(20, abs=1)
    last = messages[-1]
    # To the box's front, from where the sensor is on the vehicle.
    assert last.range == pytest.approx(0.85 - 0.018, abs=0.02)
    assert (last.radiation_type, last.header.frame_id) == (Range.INFRARED, "crazyflie/range_front")
    limits = (last.min_range, last.max_range, last.field_of_view)
    assert limits == pytest.approx((0.03, 3.5, 0.47))
    assert simulated.published("/range/left")[-1].range == pytest.approx(1.93, abs=0.02)
    assert simulated.published("/range/up")[-1].range == math.inf


def test_they_see_what_moves(simulated):
    fly(simulated, 0.2, box=1.5)
    assert simulated.published("/range/front")[-1].range == pytest.approx(1.332, abs=0.02)


def test_stamps_are_those_of_the_pose_and_frames_go_with_it(simulated):
    lookup = simulated.handle("/other").listen_to_transforms()
    fly(simulated, 1.0)
    tell(simulated, 0.0)
    simulated.advance(0.05)
    stamp = simulated.published("/range/front")[-1].header.stamp.to_sec()
    assert stamp == pytest.approx(101.0)
    frame = lookup("crazyflie", "crazyflie/range_left").transform
    assert frame.translation.y == 0.018
    assert frame.rotation.z == pytest.approx(math.sin(math.pi / 4.0))


def test_silent_without_a_pose(simulated):
    simulated.advance(1.0)
    assert simulated.published("/range/front") == []
    fly(simulated, 1.0)
    count = len(simulated.published("/range/front"))
    simulated.advance(5.0)
    assert len(simulated.published("/range/front")) <= count + 1
    assert "s old" in simulated.logged("warn")[-1]


def test_a_pose_from_before_the_clock_was_set_back_is_old(simulated):
    simulated.clock.wall_offset = 1.7e9
    fly(simulated, 1.0)
    assert simulated.logged("warn") == []
    simulated.clock.wall_offset -= 3600.0
    simulated.advance(1.0)
    assert "is -3599.0 s old" in simulated.logged("warn")[-1]


def test_silent_without_a_pose_of_the_box(simulated):
    for _ in range(20):
        simulated.publish("/tf", TFMessage([transform(simulated, "crazyflie", 0.0)]))
        simulated.advance(0.05)
    assert simulated.published("/range/front") == []
    assert "box" in simulated.logged("warn")[0]


def test_sensors_that_have_failed_are_silent(simulated):
    fly(simulated, 0.5)
    count = len(simulated.published("/range/front"))
    simulated.reconfigure("/simulated_ranger", enabled=False)
    fly(simulated, 0.5)
    assert len(simulated.published("/range/front")) == count


@pytest.mark.parametrize("name", ["world", "sensors"])
def test_a_missing_file_ends_it(name):
    process = FakeProcess()
    parameters = {"world": WORLD, "sensors": SENSORS, name: "/nowhere/file.yaml"}
    assert not process.launch(SimulatedRangerNode(), "/simulated_ranger", parameters)
    assert "/nowhere/file.yaml: cannot be read" in process.logged("error")[0]


@pytest.fixture
def deck():
    process = FakeProcess()
    parameters = {"sensors": SENSORS, "genericLogTopic_ranges_Variables": VARIABLES}
    assert process.launch(DeckRangerNode(), "/deck_ranger", parameters)
    return process


def log(process, *values):
    message = GenericLogData(values=values)
    message.header.stamp = process.handle("/other").stamp()
    process.publish("/crazyflie/ranges", message)


def test_the_decks_ranges(deck):
    log(deck, 1234.0, 20.0, 500.0, 32767.0, 3600.0, 1000.0)
    readings = {
        side: deck.published(f"/range/{side}")[-1].range
        for side in ("front", "back", "left", "right", "up")
    }
    assert readings == pytest.approx(
        {"front": 1.234, "back": -math.inf, "left": 0.5, "right": math.inf, "up": math.inf}
    )
    assert deck.published("/range/front")[-1].header.stamp.to_sec() == 100.0


def test_a_sensor_that_is_not_there_is_silent(deck):
    log(deck, 0.0, 100.0, 0.0, 0.0, 0.0, 0.0)
    assert deck.published("/range/front") == []
    assert len(deck.published("/range/back")) == 1
    assert "range.front on /crazyflie/ranges is 0: is there a deck?" in deck.logged("warn")[0]


@pytest.mark.parametrize("values", [[], [1.0] * 5, [math.nan] * 6])
def test_bad_log_blocks_are_ignored(deck, values):
    log(deck, *values)
    assert deck.published("/range/front") == []
    assert len(deck.logged("warn")) == 1


def test_a_variable_that_is_not_asked_for_is_named():
    process = FakeProcess()
    parameters = {"sensors": SENSORS, "genericLogTopic_ranges_Variables": VARIABLES[1:]}
    assert not process.launch(DeckRangerNode(), "/deck_ranger", parameters)
    assert "the sensor front reads range.front; expected one of" in process.logged("error")[0]
