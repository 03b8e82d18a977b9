"""Which bodies of which frames are published, and with what time."""

import math
import random
from itertools import pairwise

import pytest

from mocap_optitrack.bodies import RIGID_BODIES
from mocap_optitrack.frames import Frame, SeenBody
from mocap_optitrack.health import Health
from mocap_optitrack.tracker import Tracker

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
BODIES = RIGID_BODIES(
    {"1": {"pose": "one"}, "cf7": {"pose": "seven"}, "3": {"name": "My Drone", "pose": "drone"}}
)


def tracker(up_axis="z", stale_after=0.2, health=None):
    """Return a tracker of one body by its number and two by their names."""
    return Tracker(BODIES, up_axis, health or Health(BODIES, stale_after, 0.0))


def body(number=1, name=None, position=(1.0, 2.0, 3.0), quaternion=UPRIGHT, is_tracked=True):
    """Return a body of a frame."""
    return SeenBody(number, name, position, quaternion, is_tracked)


def frame(*bodies, time=10.0):
    """Return a frame of a system that tells no times."""
    return Frame(None, None, time, bodies)


def keys(poses):
    """Return the configured keys of what was seen."""
    return [pose.body.key for pose in poses]


def test_bodies_are_found_by_number_and_by_name():
    seen = tracker().process(frame(body(1, "x"), body(2, "cf7"), body(8, "My Drone"), body(9, "y")))
    assert keys(seen) == ["1", "cf7", "3"]


def test_a_name_of_its_own_counts_more_than_a_number():
    assert keys(tracker().process(frame(body(3, "another one")))) == []


def test_systems_without_numbers_may_call_a_body_one():
    assert keys(tracker().process(frame(body(None, "1"), body(None, "cf7")))) == ["1", "cf7"]


@pytest.mark.parametrize(
    "invalid",
    [
        {"is_tracked": False},
        {"position": (math.nan, 0.0, 0.0)},
        {"position": (0.0, math.inf, 0.0)},
        {"quaternion": (0.0, 0.0, 0.0, 0.0)},
        {"quaternion": (0.0, 0.0, 0.0, 2.0)},
        {"quaternion": (0.0, math.nan, 0.0, 1.0)},
    ],
)
def test_invalid_bodies_are_dropped(invalid):
    seen = tracker().process(frame(body(1, **invalid), body(2, "cf7")))
    assert keys(seen) == ["cf7"]


def test_poses_have_z_up_and_norm_1():
    (seen,) = tracker(up_axis="y").process(frame(body(quaternion=(0.0, 0.6, 0.0, 0.8001))))
    assert seen.position == (1.0, -3.0, 2.0)
    assert seen.quaternion == pytest.approx((0.0, 0.0, 0.6, 0.8), abs=1e-4)
    assert math.hypot(*seen.quaternion) == pytest.approx(1.0, abs=1e-15)


def test_frames_without_a_time_have_that_of_their_arrival():
    (seen,) = tracker().process(frame(body(), time=12.5))
    assert seen.time == 12.5


def test_frames_that_have_waited_are_older():
    tracked = tracker(stale_after=0.2)
    assert tracked.process(Frame(None, None, 12.5, (body(),), waited=0.25)) == []
    (seen,) = tracked.process(Frame(None, None, 12.5, (body(),), waited=0.125))
    assert seen.time == 12.375


def test_a_frame_that_is_not_new_is_dropped():
    one = tracker()
    assert one.process(frame(body()))
    assert not one.process(frame(body()))
    assert one.process(frame(body(), time=10.1))


def test_simulated_time_that_begins_again():
    one = tracker()
    time = settled(one)
    assert one.process(timed(time))
    assert one.process(frame(body(), time=3.0))
    assert not one.process(frame(body(), time=3.0))


def timed(server_time, latency=0.03, network=0.001):
    """Return a frame of a server whose clock is 500 s behind."""
    sent = server_time + latency
    return Frame(server_time, sent, sent + 500.0 + network, (body(),))


def settled(one):
    """Make a tracker learn the server's clock; return the server's time afterwards."""
    for k in range(1, 100):
        one.process(timed(0.01 * k))
    return 1.0


def test_nothing_is_published_before_the_servers_clock_is_known():
    one = tracker()
    assert not one.process(timed(0.01))
    assert not one.process(timed(0.02))
    assert one.process(timed(settled(one)))


def test_poses_have_the_time_of_their_exposure():
    one = tracker()
    time = settled(one)
    (seen,) = one.process(timed(time))
    assert seen.time == pytest.approx(500.0 + time, abs=0.0011)
    # One that has been held up on the way has it too.
    (seen,) = one.process(timed(time + 0.01, network=0.1))
    assert seen.time == pytest.approx(500.0 + time + 0.01, abs=0.0011)


def test_a_frame_that_is_too_old_is_dropped():
    one = tracker(stale_after=0.2)
    time = settled(one)
    assert not one.process(timed(time, network=0.18))
    assert one.process(timed(time + 0.01, network=0.16))
    assert not one.process(timed(time + 0.02, latency=0.25))


def counts(health):
    """Return how many frames were repeated, and how many of another clock."""
    values = health.report(10.0)[0].values
    return values["repeated frames"], values["frames of another clock"]


def test_after_a_silence_the_first_frame_is_published():
    one = tracker()
    time = settled(one)
    for silence in (1.2, 5.0, 600.0):
        time += silence
        (seen,) = one.process(timed(time))
        assert seen.time == pytest.approx(500.0 + time, abs=0.0011)


def test_frames_that_come_again_or_too_late_are_dropped_and_counted():
    health = Health(BODIES, 0.2, 0.0)
    one = tracker(health=health)
    time = settled(one)
    published = 0
    for k in range(100):
        published += len(one.process(timed(time + 0.01 * k)))
        assert not one.process(timed(time + 0.01 * k, network=0.002))
        assert not one.process(timed(time + 0.01 * (k - 3), network=0.032))
    assert published == 100
    assert counts(health) == ("200", "0")


@pytest.mark.parametrize("shift", [-400.0, 8.0])
def test_one_frame_with_a_wild_time_is_dropped_and_counted(shift):
    health = Health(BODIES, 0.2, 0.0)
    one = tracker(health=health)
    time = settled(one)
    wild = timed(time)
    assert not one.process(wild._replace(exposure=wild.exposure + shift, sent=wild.sent + shift))
    assert one.process(timed(time + 0.01))
    assert counts(health) == ("0", "1")


def test_an_exposure_in_the_future_is_dropped_and_counted():
    health = Health(BODIES, 0.2, 0.0)
    one = tracker(health=health)
    time = settled(one)
    assert not one.process(timed(time)._replace(exposure=time + 8.0))
    assert one.process(timed(time + 0.01))
    assert counts(health) == ("0", "1")


def test_no_stamp_is_ever_in_the_future_or_steps_back():
    one = tracker(stale_after=10.0)
    generator = random.Random(4)
    stamps = []
    for k in range(5000):
        taken = timed(0.01 * k + generator.choice([0.0] * 9 + [-0.5, -0.01, 0.02, 8.0]))
        arrival = 500.0 + 0.01 * k + 0.031 + generator.expovariate(500.0)
        for seen in one.process(taken._replace(arrival=arrival)):
            stamps.append(seen.time)
            assert seen.time < arrival + 0.005
    assert all(a < b for a, b in pairwise(stamps))
    # Four in thirteen are wrong.
    assert len(stamps) > 3300


def test_a_server_whose_clock_is_set_back_is_followed():
    one = tracker()
    time = settled(one)
    published = 0
    for k in range(100):
        late = timed(time + 0.01 * k - 300.0)
        published += len(one.process(late._replace(arrival=late.arrival + 300.0)))
    # Half a second, and ten frames.
    assert published == pytest.approx(40, abs=3)


def test_another_server_is_learned_again():
    one = tracker()
    time = settled(one)
    one.restart()
    assert not one.process(timed(time))
