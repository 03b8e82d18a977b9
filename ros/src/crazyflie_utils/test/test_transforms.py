"""tf within a process: tf2's semantics, and no nonsense let in."""

import math
import threading

import genpy
import pytest
import tf2_py
from hypothesis import given
from hypothesis import strategies as st
from tf2_msgs.msg import TFMessage
from transform_helpers import hear, transform, x_of

from crazyflie_utils import TransformError
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.tf.frame_tree import StampedPose


def test_latest_transform_with_its_own_stamp(process, lookup):
    hear(process, transform("world", "crazyflie", 100.0, x=1.0))
    hear(process, transform("world", "crazyflie", 100.5, x=2.0))
    found = lookup("world", "crazyflie")
    assert found.transform.translation.x == 2.0
    assert found.header.stamp.to_sec() == 100.5
    assert (found.header.frame_id, found.child_frame_id) == ("world", "crazyflie")


@given(st.integers(1, 2_000_000_000), st.integers(0, 999_999_999))
def test_stamps_come_back_to_the_nanosecond(seconds, nanoseconds):
    process = FakeProcess(start=seconds + 1.0)
    lookup = process.handle("/node").listen_to_transforms()
    message = transform("world", "crazyflie", 0.0)
    message.header.stamp = genpy.Time(seconds, nanoseconds)
    hear(process, message)
    assert lookup("world", "crazyflie").header.stamp == genpy.Time(seconds, nanoseconds)


def test_transforms_of_many_threads(process, lookup):
    process.clock.set(103.0)
    failures = []

    def broadcast(child):
        try:
            for count in range(300):
                hear(process, transform("world", child, 100.0 + count * 0.01))
        except Exception as error:
            failures.append(error)

    threads = [threading.Thread(target=broadcast, args=(f"cf{n}",)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
    assert failures == []
    assert lookup("world", "cf0").header.stamp.to_sec() == pytest.approx(102.99)


def test_looks_in_both_directions(process, lookup):
    hear(process, transform("world", "crazyflie", 100.0, x=1.0))
    assert lookup("crazyflie", "world").transform.translation.x == -1.0


def test_chains_frames_at_their_latest_common_time(process, lookup):
    for time, x in ((100.0, 1.0), (101.0, 2.0)):
        hear(process, transform("world", "cage", time, x=x))
    hear(process, transform("cage", "crazyflie", 100.5, x=10.0))
    found = lookup("world", "crazyflie")
    assert found.header.stamp.to_sec() == 100.5
    assert found.transform.translation.x == pytest.approx(11.5)


def test_a_transform_at_a_time(process, lookup):
    for time, x in ((100.0, 1.0), (101.0, 2.0)):
        hear(process, transform("world", "crazyflie", time, x=x))
    stamp = genpy.Time(100, 250_000_001)
    with pytest.raises(tf2_py.ExtrapolationException):
        lookup("world", "crazyflie", genpy.Time(90))
    process.clock.set(102.0)
    hear(process, transform("world", "crazyflie", 101.5, x=2.5))
    found = lookup("world", "crazyflie", stamp)
    assert found.transform.translation.x == pytest.approx(1.25)
    assert found.header.stamp == stamp
    assert lookup("world", "crazyflie").transform.translation.x == 2.5
    with pytest.raises(tf2_py.ExtrapolationException):
        lookup("world", "crazyflie", genpy.Time(103))


def test_static_broadcasts_add_up(process, lookup):
    broadcast = process.handle("/mount").broadcast_static_transforms()
    for child, x in (("camera", 0.1), ("deck", 0.2), ("camera", 0.3)):
        broadcast([transform("crazyflie", child, 0.0, x=x)])
    sent = process.published("/tf_static")[-1].transforms
    assert [each.child_frame_id for each in sent] == ["camera", "deck"]
    assert lookup("crazyflie", "camera").transform.translation.x == pytest.approx(0.3)
    assert lookup("crazyflie", "deck").transform.translation.x == pytest.approx(0.2)


def test_static_transforms_hold_at_any_time(process, lookup):
    hear(process, transform("crazyflie", "base", 0.0, x=0.1), topic="/tf_static")
    hear(process, transform("world", "crazyflie", 100.0, yaw=math.pi / 2))
    found = lookup("world", "base").transform.translation
    assert (found.x, found.y) == pytest.approx((0.0, 0.1), abs=1e-12)


def test_unknown_and_unconnected_frames_are_named(process, lookup):
    with pytest.raises(tf2_py.LookupException, match="world"):
        lookup("world", "crazyflie")
    hear(process, transform("world", "crazyflie", 100.0), transform("map", "other", 100.0))
    with pytest.raises(TransformError, match="nowhere"):
        lookup("world", "nowhere")
    with pytest.raises(tf2_py.ConnectivityException, match=r"world.*other|other.*world"):
        lookup("world", "other")


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["translation.x", "rotation.w"])
def test_what_is_not_finite_is_dropped_with_a_warning(process, lookup, field, bad):
    hear(process, transform("world", "crazyflie", 100.0, x=1.0))
    wrong = transform("world", "crazyflie", 100.1, x=2.0)
    part, name = field.split(".")
    setattr(getattr(wrong.transform, part), name, bad)
    hear(process, wrong, transform("world", "other", 100.1, x=3.0))
    assert lookup("world", "crazyflie").transform.translation.x == 1.0
    assert lookup("world", "other").transform.translation.x == 3.0
    assert process.logged("warn") == [
        "/tf: ignoring a transform world -> crazyflie that is not finite"
    ]


def test_what_is_no_rotation_is_dropped_with_a_warning(process, lookup):
    wrong = transform("world", "crazyflie", 100.0)
    wrong.transform.rotation.w = 0.0
    hear(process, wrong)
    with pytest.raises(TransformError):
        lookup("world", "crazyflie")
    assert process.logged("warn") == [
        "/tf: ignoring a transform world -> crazyflie that has no unit quaternion"
    ]


def test_the_same_warning_is_throttled(process, lookup):
    wrong = transform("world", "crazyflie", 100.0, x=math.nan)
    for _ in range(100):
        hear(process, wrong)
    hear(process, transform("world", "other", 100.0, x=math.nan))
    assert len(process.logged("warn")) == 2


def test_reset_of_time_forgets_what_moves_and_keeps_what_is_static(process, lookup):
    hear(process, transform("crazyflie", "base", 0.0, x=0.1), topic="/tf_static")
    hear(process, transform("world", "crazyflie", 100.0, x=1.0))
    process.clock.set(1.0)
    with pytest.raises(TransformError, match="of frame crazyflie has come since time was set back"):
        lookup("world", "base")
    hear(process, transform("world", "crazyflie", 1.0, x=5.0))
    assert lookup("world", "base").transform.translation.x == pytest.approx(5.1)
    assert lookup("world", "crazyflie").header.stamp.to_sec() == 1.0


def test_broadcasts_leave_the_process_and_are_known_in_it(process):
    broadcast = process.handle("/simulator").broadcast_transforms()
    lookup = process.handle("/estimator").listen_to_transforms()
    batch = [transform("world", f"cf{n}", 100.0, x=float(n)) for n in range(3)]
    broadcast(batch)
    (message,) = process.published("/tf")
    assert message.transforms == batch
    assert lookup("world", "cf2").transform.translation.x == 2.0


def test_poses_leave_the_process_as_messages_and_are_known_in_it(process):
    broadcast = process.handle("/simulator").broadcast_poses()
    heard = []
    process.topics.subscribe("/tf", TFMessage, heard.append)
    lookup = process.handle("/estimator").listen_to_poses()
    batch = [
        StampedPose("world", f"cf{n}", 99_123_456_789 + n, (n, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))
        for n in range(3)
    ]
    broadcast(batch)
    assert [lookup("world", f"cf{n}") for n in range(3)] == batch
    for message in (*process.published("/tf"), *heard):
        assert [StampedPose.of(each) for each in message.transforms] == batch
        assert message.transforms == [pose.message() for pose in batch]
    assert len(heard) == len(process.published("/tf")) == 1


def test_of_poses_without_another_subscriber_no_message_is_made(process, monkeypatch):
    broadcast = process.handle("/simulator").broadcast_poses()
    lookup = process.handle("/estimator").listen_to_poses()
    monkeypatch.setattr(process.transport.publishers["/tf"], "has_subscribers", lambda: False)
    pose = StampedPose("world", "crazyflie", 99_000_000_000, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))
    broadcast([pose])
    assert lookup("world", "crazyflie") == pose
    assert process.published("/tf") == []


def test_nodes_share_one_buffer_and_one_broadcaster(process):
    lookups = [process.handle(name).listen_to_transforms() for name in ("/a", "/b")]
    broadcasts = [process.handle(name).broadcast_transforms() for name in ("/a", "/b")]
    broadcasts[0]([transform("world", "cf1", 100.0)])
    broadcasts[1]([transform("world", "cf2", 100.0)])
    assert len(process.published("/tf")) == 2
    assert len(process.transport.subscribers["/tf"]) == 1
    for lookup in lookups:
        assert lookup("cf1", "cf2").header.stamp.to_sec() == 100.0


# Stamps that cannot be.


def test_a_pose_from_the_future_does_not_stop_the_present(process, lookup):
    hear(process, transform("world", "crazyflie", 100.0, x=1.0))
    hear(process, transform("world", "crazyflie", 190.0, x=9.0))
    assert x_of(lookup) == 1.0
    process.clock.set(100.1)
    hear(process, transform("world", "crazyflie", 100.1, x=2.0))
    assert x_of(lookup) == 2.0
    (warning,) = process.logged("warn")
    assert warning == "/tf: ignoring a transform world -> crazyflie that is stamped in the future"
    assert process.handle("/node").rejected_transforms() == {"is stamped in the future": 1}


def test_a_clock_that_comes_late_in_fast_simulated_time_is_not_complained_of(process, lookup):
    hear(process, transform("world", "crazyflie", 100.0, x=1.0))
    # A process that was stopped for 0.3 s reads /tf before /clock.
    hear(process, transform("world", "crazyflie", 108.0, x=9.0))
    assert x_of(lookup) == 1.0
    process.clock.set(108.1)
    hear(process, transform("world", "crazyflie", 108.1, x=2.0))
    assert x_of(lookup) == 2.0
    assert process.logged("warn") == []
    assert process.handle("/node").rejected_transforms() == {"is stamped in the future": 1}


def test_poses_that_come_before_the_first_clock_are_not_complained_of():
    process = FakeProcess(start=0.0)
    lookup = process.handle("/node").listen_to_transforms()
    hear(process, transform("world", "crazyflie", 87.3, x=1.0))
    with pytest.raises(TransformError):
        lookup("world", "crazyflie")
    process.clock.set(87.3)
    hear(process, transform("world", "crazyflie", 87.4, x=2.0))
    assert x_of(lookup) == 2.0
    assert process.logged("warn") == []


def test_a_clock_that_is_set_back_is_followed_after_two_poses(process, lookup):
    hear(process, transform("crazyflie", "base", 0.0, x=0.1), topic="/tf_static")
    hear(process, transform("world", "crazyflie", 100.0, x=1.0))
    for count, seen in enumerate((1.0, 1.0, 4.0, 5.0)):
        hear(process, transform("world", "crazyflie", 97.0 + 0.01 * count, x=2.0 + count))
        assert x_of(lookup) == seen
    assert lookup("world", "base").header.stamp.to_sec() == pytest.approx(97.03)


def test_poses_that_overtake_each_other_are_no_step_back(process, lookup):
    for count in range(20):
        hear(process, transform("world", "crazyflie", 100.0 + 0.01 * (count ^ 1), x=count ^ 1))
        # The old ones of a second source never take over.
        hear(process, transform("world", "crazyflie", 90.0 + 0.01 * count, x=-9.0))
    assert x_of(lookup) == 19.0


def test_a_pose_that_repeats_is_not_kept(process, lookup, monkeypatch):
    stored = []
    for x in (1.0, 2.0, 3.0):
        hear(process, transform("world", "crazyflie", 100.0, x=x))
        stored.append(x_of(lookup))
    assert stored == [1.0, 1.0, 1.0]
    assert process.logged("warn") == []


@pytest.mark.parametrize(
    ("parent", "child"), [("", "crazyflie"), ("world", ""), ("/", "crazyflie"), ("", "")]
)
@pytest.mark.parametrize("topic", ["/tf", "/tf_static"])
def test_frames_without_a_name_are_ignored(process, lookup, capfd, parent, child, topic):
    for count in range(100):
        hear(process, transform(parent, child, 100.0 + 0.01 * count), topic=topic)
    (warning,) = process.logged("warn")
    assert "does not name its frames" in warning
    assert capfd.readouterr().err == ""
    assert process.handle("/node").rejected_transforms() == {"does not name its frames": 100}


def test_frames_without_end_are_not_kept_without_end(process, lookup):
    hear(process, transform("world", "crazyflie", 100.0, x=1.0))
    for count in range(3000):
        hear(process, transform("world", f"junk{count}", 100.0))
    with pytest.raises(TransformError):
        lookup("world", "junk2999")
    assert len(process.logged("warn")) < 100
    hear(process, transform("world", "crazyflie", 100.1, x=2.0))
    assert x_of(lookup) == 2.0


def test_what_timers_broadcast_at_once_is_one_message(process):
    handle = process.handle("/node")
    broadcast = handle.broadcast_poses()
    handle.broadcast_poses()

    def tell(child):
        stamp = handle.nanoseconds()
        broadcast([StampedPose("world", child, stamp, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))])

    handle.timer(0.1, lambda: tell("one"))
    handle.timer(0.2, lambda: tell("two"))
    process.advance(0.2)
    told = [[t.child_frame_id for t in m.transforms] for m in process.published("/tf")]
    assert [sorted(each) for each in told] == [["one"], ["one", "two"]]
    tell("three")
    assert len(process.published("/tf")) == 3
