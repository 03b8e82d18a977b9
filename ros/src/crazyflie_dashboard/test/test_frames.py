"""Poses of /tf, decoded when they are shown."""

import math

import numpy as np
import pytest

from crazyflie_dashboard.frames import Frames
from crazyflie_utils.tf.frame_tree import StampedPose, encode_poses

LEVEL = (0.0, 0.0, 0.0, 1.0)
QUARTER = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))


class Clock:
    now = 10.0

    def time(self):
        return self.now

    def nanoseconds(self):
        return round(self.now * 1e9)


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def frames(clock):
    return Frames(clock.time, clock.nanoseconds, 0.2)


def send(frames, *poses):
    frames.read(encode_poses(poses).raw)
    frames.update()


def test_velocity_and_age_follow_from_stamps(frames, clock):
    send(frames, StampedPose("world", "cf1", 9_950_000_000, (0.0, 0.0, 0.0), LEVEL))
    assert frames.age("cf1") == pytest.approx(0.05)
    clock.now += 0.1
    send(frames, StampedPose("world", "cf1", 10_050_000_000, (0.1, 0.0, 0.2), LEVEL))
    assert frames.poses["cf1"].velocity == pytest.approx((1.0, 0.0, 2.0))
    clock.now += 2.0
    # The same stamp again is not a new pose.
    send(frames, StampedPose("world", "cf1", 10_050_000_000, (0.1, 0.0, 0.2), LEVEL))
    assert frames.age("cf1") == pytest.approx(2.05)


def test_a_frame_below_others_is_in_the_fixed_frame(frames):
    send(
        frames,
        StampedPose("world", "mocap", 1, (1.0, 0.0, 0.0), QUARTER),
        StampedPose("mocap", "cf1", 1, (1.0, 0.0, 0.5), QUARTER),
    )
    position, rotation = frames.in_fixed("cf1", "world")
    assert position == pytest.approx((1.0, 1.0, 0.5))
    assert np.abs(rotation) == pytest.approx((0.0, 0.0, 1.0, 0.0), abs=1e-12)
    assert frames.root("cf1") == "world"


def test_a_loop_of_frames_has_an_end(frames):
    send(
        frames,
        StampedPose("b", "a", 1, (0.0, 0.0, 0.0), LEVEL),
        StampedPose("a", "b", 1, (0.0, 0.0, 0.0), LEVEL),
    )
    assert frames.in_fixed("a", "world") is None
    assert frames.root("a") in ("a", "b")
    assert frames.in_fixed("nothing", "world") is None


def test_what_is_no_message_is_passed_over(frames):
    frames.read(b"\xff\xff\xff\xff")
    frames.read(b"")
    frames.update()
    assert frames.poses == {}


def test_rates_are_those_of_messages(frames, clock):
    for k in range(50):
        pose = StampedPose("world", "cf1", k + 1, (0.0, 0.0, 0.0), LEVEL)
        frames.read(encode_poses([pose]).raw)
    clock.now += 2.0
    frames.update()
    assert frames.poses["cf1"].rate == pytest.approx(25.0)


def test_a_frame_that_has_gone_is_forgotten_and_one_that_holds_for_ever_is_not(frames, clock):
    frames.read_static(StampedPose("world", "table", 1, (0.0, 0.0, 0.0), LEVEL))
    send(frames, StampedPose("world", "wand", 10_000_000_000, (0.0, 0.0, 0.0), LEVEL))
    for _ in range(31):
        clock.now += 1.0
        frames.update()
    assert list(frames.poses) == ["table"]
    send(frames, StampedPose("world", "wand", 41_000_000_000, (0.0, 0.0, 0.0), LEVEL))
    assert frames.age("wand") == 0.0
