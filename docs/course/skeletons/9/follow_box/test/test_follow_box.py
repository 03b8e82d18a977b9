"""Following, a deck of one's own, and the check of a sensor."""

import math
from pathlib import Path

import pytest
from sensor_msgs.msg import Range

from crazyflie_ranging.range_sensors import load
from crazyflie_utils.testing import FakeProcess
from follow_box.check_node import CheckNode
from follow_box.follow_node import FollowNode
from follow_box.follower import Follower
from follow_box.sensor_check import Reading, faults

DECK = Path(__file__).resolve().parents[1] / "config" / "my_deck.yaml"


@pytest.mark.parametrize(
    ("reading", "speed"),
    [
        (0.5, 0.0),
        (0.6, 0.08),
        (0.4, -0.08),
        (1.9, 0.3),
        (0.05, -0.3),
        (2.1, 0.0),
        (math.inf, 0.0),
        (-math.inf, -0.3),
        (None, 0.0),
    ],
)
def test_step_1_the_speed_is_in_proportion_to_the_error(reading, speed):
    assert Follower().speed(reading) == pytest.approx(speed)


def test_step_1_a_box_that_moves_is_followed_without_swinging():
    follower, gap, gaps = Follower(), 1.0, []
    for k in range(600):  # 30 s: the box goes away at 0.15 m/s for 15 s, then it rests
        gap += 0.05 * ((0.15 if k < 300 else 0.0) - follower.speed(gap))
        gaps.append(gap)
    assert gaps[-1] == pytest.approx(0.5, abs=0.01)
    assert min(gaps) > 0.49


@pytest.fixture
def process():
    """Return a process with the node in it."""
    fake = FakeProcess()
    assert fake.launch(FollowNode(), "/follow_box")
    return fake


def last(process):
    """Return the last speed ahead that was published, m/s."""
    return process.published("/cmd_vel/wanted")[-1].linear.x


def test_steps_2_and_3_the_node_follows(process):
    for _ in range(4):
        process.publish("/range/front", Range(range=0.6))
        process.advance(0.05)
    assert last(process) == pytest.approx(0.08)


def test_step_3_a_silent_sensor_stops_the_vehicle(process):
    process.advance(0.5)
    assert last(process) == 0.0
    process.publish("/range/front", Range(range=0.6))
    process.advance(0.5)
    assert last(process) == 0.0


def test_step_4_the_deck_is_described():
    front, down = load(DECK)
    assert (front.name, front.type, front.direction) == ("front", "laser", "front")
    assert (down.name, down.type, down.direction) == ("down", "ultrasonic", "down")
    assert (front.position, down.position) == ((0.02, 0.0, 0.005), (0.0, 0.0, -0.01))
    assert (front.min_range, front.max_range, front.spread_angle) == (0.05, 2.0, 0.3)
    assert (down.min_range, down.max_range, down.spread_angle) == (0.1, 3.0, 0.6)
    assert (front.desired_frequency, down.desired_frequency) == (25.0, 10.0)
    assert (front.noise, down.noise) == (0.01, 0.02)


def readings(*distances, count=40):
    """Return ``count`` readings within 2 s, the distances again and again."""
    return [Reading(0.05 * k, distances[k % len(distances)]) for k in range(count)]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (readings(1.0, 1.01), []),
        (readings(math.inf), []),
        (readings(1.0, count=1), ["silent"]),
        (readings(1.0, 1.01, count=30), ["too slow"]),
        (readings(1.0, 3.6), ["out of range"]),
        (readings(1.0, 0.01), ["out of range"]),
        (readings(1.0, math.nan), ["out of range"]),
        (readings(1.0), ["stuck"]),
        (readings(9.0, count=10), ["too slow", "out of range", "stuck"]),
    ],
    ids=["good", "nothing", "silent", "slow", "far", "near", "nan", "stuck", "all"],
)
def test_step_5_faults_are_named(given, expected):
    assert faults(given, min_range=0.03, max_range=3.5, rate=20.0) == expected


def test_step_5_the_node_says_pass_or_fail():
    process = FakeProcess()
    assert process.launch(CheckNode(), "/check_range")
    for k in range(41):
        process.publish("/range/front", Range(range=1.0 + 0.001 * k, min_range=0.03, max_range=3.5))
        process.advance(0.05)
    assert process.logged("info")[-1].endswith("PASS: /range/front")
    process.advance(2.0)
    assert process.logged("error")[-1].endswith("FAIL: /range/front: silent")
