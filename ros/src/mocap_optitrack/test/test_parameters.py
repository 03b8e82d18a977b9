"""Content of mocap.yaml."""

import pytest

from mocap_optitrack.bodies import RIGID_BODIES, RigidBody
from mocap_optitrack.mocap_parameters import ADDRESS, GROUP, STREAM_VERSION, MocapParameters

ROBOT = {
    "pose": "Robot_1/pose",
    "pose2d": "Robot_1/ground_pose",
    "child_frame_id": "Robot_1/base_link",
    "parent_frame_id": "world",
}


def bodies(value):
    return RIGID_BODIES(value)


def test_a_body_by_its_number():
    (body,) = bodies({"1": ROBOT})
    assert body == RigidBody(key="1", **ROBOT)
    assert (body.name, body.label) == (None, "1")


def test_bodies_by_name():
    key_is_name, name_apart = bodies(
        {"cf7": {"pose": "pose7"}, "2": {"name": "My Drone", "child_frame_id": "/drone"}}
    )
    assert (key_is_name.name, name_apart.name) == ("cf7", "My Drone")
    assert key_is_name == RigidBody(key="cf7", pose="pose7")
    assert name_apart == RigidBody(key="2", own_name="My Drone", child_frame_id="drone")
    assert (key_is_name.label, name_apart.label) == ("cf7", "2 (My Drone)")


def test_a_number_without_quotes_is_a_number_too():
    assert bodies({1: ROBOT}) == bodies({"1": ROBOT})


def test_entries_without_a_meaning_are_named():
    value = {"1": {**ROBOT, "odom": "Robot_1/Odom", "tf": "tf"}}
    parameters = MocapParameters.from_mapping({"rigid_bodies": value})
    assert parameters.unknown == ["rigid_bodies/1/odom", "rigid_bodies/1/tf"]


def test_all_that_is_wrong_is_named_at_once():
    value = {"1": {"pose": 3, "pose2d": 4}, "2": None, "a": {"pose": "p"}, "b": {"pose": "p"}}
    with pytest.raises(ValueError) as error:
        RIGID_BODIES(value)
    for reason in ("1/pose is 3", "1/pose2d is 4", "2 is None", "a and b share topic 'p'"):
        assert reason in str(error.value)


@pytest.mark.parametrize(
    "value",
    [
        {"1": "x" * 200_000},
        {"x" * 200_000: {}},
        {"1": {"pose": "x " * 100_000}},
        {"1": {"pose": "x" * 200_000}, "2": {"pose": "x" * 200_000}},
    ],
    ids=map(str, range(4)),
)
def test_what_is_long_is_cut_in_messages(value):
    with pytest.raises(ValueError) as error:
        RIGID_BODIES(value)
    assert 0 < len(str(error.value)) < 500


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ([], ""),
        ({}, ""),
        ({"1": None}, "1 is None"),
        ({"1": {}}, "1 has neither"),
        ({"1": {"parent_frame_id": "world"}}, "1 has neither"),
        ({"1": {"pose": "not a topic"}}, "1/pose is 'not a topic'"),
        ({"1": {"pose2d": 3}}, "1/pose2d is 3"),
        ({"1": {"child_frame_id": ""}}, "1/child_frame_id is ''"),
        ({"1": {"pose": "a"}, "2": {"pose": "a"}}, "1 and 2 share topic 'a'"),
        ({"1": {"pose": "a", "pose2d": "a"}}, "share topic 'a'"),
        (
            {"1": {"child_frame_id": "a"}, "2": {"child_frame_id": "/a"}},
            "1 and 2 share child_frame_id",
        ),
        ({"1": {"name": "a", "pose": "b"}, "a": {"pose": "c"}}, "1 and a share name 'a'"),
    ],
)
def test_bad_bodies_are_refused(value, reason):
    with pytest.raises(ValueError) as error:
        RIGID_BODIES(value)
    assert reason in str(error.value)


@pytest.mark.parametrize("value", ["192.168.1.20", "127.0.0.1"])
def test_addresses(value):
    assert ADDRESS(value) == value
    with pytest.raises(ValueError):
        GROUP(value)


@pytest.mark.parametrize("value", ["224.0.0.1", "239.255.42.99"])
def test_addresses_of_groups(value):
    assert GROUP(value) == value
    with pytest.raises(ValueError):
        ADDRESS(value)


@pytest.mark.parametrize("value", ["", "motive", "300.1.1.1", 5, None])
def test_what_is_no_address(value):
    with pytest.raises(ValueError):
        ADDRESS(value)


@pytest.mark.parametrize("value", ["3.1", 3.1, "3.1.0.0", [3, 1, 0, 0], [3, 1]])
def test_stream_versions(value):
    assert STREAM_VERSION(value) == "3.1"


@pytest.mark.parametrize("value", ["", "new", 3, True, [3], [1, 9], "3.x", "4.1.0.0.0"])
def test_what_is_no_stream_version(value):
    with pytest.raises(ValueError):
        STREAM_VERSION(value)
