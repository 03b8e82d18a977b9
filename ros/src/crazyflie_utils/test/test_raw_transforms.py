"""tf from other processes: only what is looked up is decoded."""

import io
import struct

import genpy
import pytest
import tf2_ros
from hypothesis import given
from hypothesis import strategies as st
from tf2_msgs.msg import TFMessage
from transform_helpers import hear, transform, x_of

from crazyflie_utils import TransformError
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.tf import frame_tree
from crazyflie_utils.tf.frame_tree import RawTransforms, StampedPose


def raw(*transforms):
    buffer = io.BytesIO()
    TFMessage(list(transforms)).serialize(buffer)
    return RawTransforms().deserialize(buffer.getvalue())


def hear_raw(process, *transforms):
    process.publish("/tf", raw(*transforms))


@pytest.fixture
def decoded(monkeypatch):
    """Return the child frames that are decoded, in order."""
    frames = []
    decode = frame_tree.decode_pose

    def note(*arguments):
        pose = decode(*arguments)
        frames.append(pose.child)
        return pose

    monkeypatch.setattr(frame_tree, "decode_pose", note)
    return frames


def test_raw_message_is_a_tf_message_for_every_other_subscriber():
    message = raw(transform("world", "cf1", 100.0), transform("world", "cf2", 100.0))
    assert isinstance(message, TFMessage)
    assert [each.child_frame_id for each in message.transforms] == ["cf1", "cf2"]
    assert RawTransforms().transforms == []


def test_decodes_what_is_looked_up_and_what_is_above_it(process, lookup, decoded):
    hear_raw(process, transform("world", "cage", 100.0), transform("world", "other", 100.0))
    hear_raw(process, transform("cage", "crazyflie", 100.0))
    assert decoded == []
    assert lookup("world", "crazyflie").header.stamp.to_sec() == 100.0
    assert decoded == ["crazyflie", "cage"]
    for child in ("crazyflie", "other", "cage", "crazyflies", "world2"):
        hear_raw(process, transform("world", child, 100.1))
    assert decoded == ["crazyflie", "cage", "crazyflie", "cage"]


def test_what_was_said_once_is_found_later(process, lookup, decoded):
    hear_raw(process, transform("world", "early", 99.0, x=1.0))
    hear_raw(process, transform("world", "early", 99.1, x=2.0))
    for count in range(500):
        hear_raw(process, transform("world", "crazyflie", 99.5 + 0.001 * count))
    assert lookup("world", "early").transform.translation.x == 2.0
    assert decoded == ["early"]


def test_frame_that_gets_another_parent(process, lookup):
    hear_raw(process, transform("world", "crazyflie", 100.0, x=1.0))
    assert x_of(lookup) == 1.0
    hear_raw(process, transform("world", "cage", 100.1, x=5.0))
    hear_raw(process, transform("cage", "crazyflie", 100.1, x=1.0))
    assert x_of(lookup) == 6.0


def test_static_frames_are_known_from_the_beginning(process, lookup):
    hear(process, transform("crazyflie", "camera", 0.0, x=0.1), topic="/tf_static")
    hear_raw(process, transform("world", "crazyflie", 100.0, x=1.0))
    assert lookup("world", "camera").transform.translation.x == pytest.approx(1.1)


def test_a_leading_slash_is_the_same_frame(process, lookup):
    hear_raw(process, transform("/world", "/crazyflie", 100.0, x=1.0))
    assert x_of(lookup) == 1.0
    hear_raw(process, transform("world", "/crazyflie", 100.1, x=2.0))
    assert x_of(lookup) == 2.0


def test_frames_without_a_name_are_counted_without_a_lookup(process, lookup, capfd):
    for count in range(100):
        hear_raw(process, transform("", "", 100.0 + 0.01 * count))
    hear_raw(process, transform("world", "/", 100.0))
    assert process.handle("/node").rejected_transforms() == {"does not name its frames": 101}
    assert len(process.logged("warn")) == 2
    assert capfd.readouterr().err == ""


def test_a_name_that_is_no_text_hides_nothing(process, lookup):
    with pytest.raises(TransformError):
        lookup("world", "crazyflie")
    message = raw(transform("wor?d", "crazyflie", 100.0), transform("world", "crazyflie", 100.5))
    process.publish("/tf", RawTransforms().deserialize(message.raw.replace(b"wor?d", b"wor\xffd")))
    assert lookup("world", "crazyflie").header.stamp.to_sec() == 100.5


def test_tf2_is_given_only_the_frames_that_it_is_needed_for(process, lookup, monkeypatch):
    given = []
    monkeypatch.setattr(
        StampedPose,
        "message",
        lambda self, message=StampedPose.message: given.append(self) or message(self),
    )
    for time in (100.0, 100.1):
        moving = [transform("world", child, time, x=time) for child in ("cage", "other")]
        hear(process, *moving, transform("cage", "crazyflie", time, x=1.0))
    assert x_of(lookup) == pytest.approx(101.1)
    given.clear()
    hear(process, transform("world", "cage", 100.2), transform("world", "other", 100.2))
    assert [pose.child for pose in given] == ["cage"]


def test_in_the_past_a_frame_has_the_parent_of_then(process, lookup):
    hear(process, transform("world", "cage", 99.0, x=5.0), transform("world", "cage", 100.0, x=5.0))
    for time, parent in ((99.0, "cage"), (99.5, "cage"), (100.0, "world")):
        hear(process, transform(parent, "crazyflie", time, x=1.0))
    found = lookup("world", "crazyflie", genpy.Time(99, 250_000_000))
    assert found.transform.translation.x == pytest.approx(6.0)


@given(st.binary(max_size=200))
def test_any_bytes_are_borne(junk):
    process = FakeProcess()
    lookup = process.handle("/node").listen_to_transforms()
    process.publish("/tf", RawTransforms().deserialize(junk))
    with pytest.raises(TransformError):
        lookup("world", "crazyflie")
    hear_raw(process, transform("world", "crazyflie", 100.0, x=1.0))
    assert x_of(lookup) == 1.0
    assert process.logged("error") == []


@pytest.mark.parametrize("cut", [3, 4, 15, 30, 60, 119])
@pytest.mark.parametrize("count", [1, 2**32 - 1])
def test_a_message_that_says_it_is_longer_than_it_is(process, lookup, cut, count):
    whole = raw(transform("world", "crazyflie", 100.0)).raw
    with pytest.raises(TransformError):
        lookup("world", "crazyflie")
    cut_off = (struct.pack("<I", count) + whole[4:])[: min(cut, len(whole) - 1)]
    for _ in range(100):
        process.publish("/tf", RawTransforms().deserialize(cut_off))
    with pytest.raises(TransformError):
        lookup("world", "crazyflie")
    assert process.handle("/node").rejected_transforms() == {"cannot be read": 100}
    assert process.logged("warn") == ["/tf: ignoring a message on /tf that cannot be read"]


def test_frames_without_end_are_not_kept(process, lookup):
    hear_raw(process, transform("world", "crazyflie", 100.0))
    x_of(lookup)
    # Not its parent, so that tf2 begins.
    lookup("crazyflie", "world")
    kept = process.transforms._tree
    for count in range(3000):
        hear_raw(process, transform("world", f"junk{count}", 100.0))
        hear_raw(process, transform(f"junk{count}", "crazyflie", 100.0 + 1e-4 * count))
        hear(process, transform("world", f"static{count}", 0.0), topic="/tf_static")
    hear_raw(process, transform("world", "n" * 10_000, 100.0))
    for memory in (kept._unread, kept._names, kept.followed, kept._frames):
        assert len(memory) <= 1001
    assert frame_tree._names.cache_info().currsize <= 1000
    assert max(map(len, kept._unread.values())) < 1024
    assert kept._tf2.all_frames_as_yaml().count("parent:") <= 1000
    hear_raw(process, transform("world", "crazyflie", 100.4, x=2.0))
    assert x_of(lookup) == 2.0


def test_long_chains_are_followed(process, lookup):
    for count in range(900):
        hear_raw(process, transform(f"f{count}", f"f{count + 1}", 100.0, x=1.0))
    assert lookup("f0", "f900").transform.translation.x == pytest.approx(900.0)


FRAMES = [f"f{number}" for number in range(7)]


@st.composite
def trees(draw):
    """Return child -> (parent, is static) of a random tree, or two."""
    return {
        FRAMES[k]: (FRAMES[draw(st.integers(0, k - 1))], draw(st.integers(0, 3)) == 0)
        for k in range(1, len(FRAMES))
        if draw(st.integers(0, 9)) < 9
    }


@given(
    tree=trees(),
    rounds=st.lists(
        st.tuples(
            st.permutations(FRAMES[1:]),
            st.integers(1, 6),
            st.lists(st.tuples(st.sampled_from(FRAMES), st.sampled_from(FRAMES)), max_size=3),
        ),
        min_size=1,
        max_size=6,
    ),
)
def test_answers_are_those_of_a_buffer_that_knows_everything(tree, rounds):
    process, full = FakeProcess(), tf2_ros.Buffer(debug=False)
    lookup = process.handle("/node").listen_to_transforms()
    for child, (parent, is_static) in tree.items():
        if is_static:
            hear(process, transform(parent, child, 0.0, x=1.0, yaw=0.3), topic="/tf_static")
            full.set_transform_static(transform(parent, child, 0.0, x=1.0, yaw=0.3), "test")

    def answer(ask, *arguments):
        try:
            found = ask(*arguments)
        except (TransformError, tf2_ros.TransformException):
            return None
        return found.header.stamp.to_sec(), found.transform

    asked = set()
    for count, (order, batch, pairs) in enumerate(rounds):
        stamp = 90.0 + count
        moving = [
            transform(tree[child][0], child, stamp, x=count + 0.1 * int(child[1:]), yaw=0.2 * count)
            for child in order
            if child in tree and not tree[child][1]
        ]
        for start in range(0, len(moving), batch):
            hear_raw(process, *moving[start : start + batch])
        for each in moving:
            full.set_transform(each, "test")
        asked.update(pairs)
        # Those of earlier rounds, too: what was widened must not lose what was known.
        for target, source in asked:
            assert answer(lookup, target, source) == answer(
                full.lookup_transform_core, target, source, genpy.Time()
            )
