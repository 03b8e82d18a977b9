"""Which changes of rospy are made, and when rospy stays as it is."""

import pytest

from crazyflie_utils.ros1 import patches


@pytest.fixture
def log(monkeypatch):
    """Return the warnings; the table is inspected again."""
    texts = []
    monkeypatch.setattr("rospy.logwarn", texts.append)
    monkeypatch.delenv(patches.SWITCH, raising=False)
    monkeypatch.setattr(patches, "active", patches.active.__wrapped__)
    return texts


def test_all_fit_this_rospy(log):
    assert patches.active() == set(patches.PATCHES)
    assert log == []


@pytest.mark.parametrize(
    ("value", "on"),
    [
        ("all", set(patches.PATCHES)),
        ("none", set()),
        ("", set()),
        ("connect_once,send_at_once", {"connect_once", "send_at_once"}),
    ],
)
def test_the_environment_switches(log, monkeypatch, value, on):
    monkeypatch.setenv(patches.SWITCH, value)
    assert patches.active() == on
    assert log == []


def test_an_unknown_name_is_named(log, monkeypatch):
    monkeypatch.setenv(patches.SWITCH, "connect_twice")
    assert patches.active() == set()
    assert "unknown patch connect_twice; expected all, none or skip_self_connections," in log[0]


@pytest.mark.parametrize(
    "changed", [lambda self, connection, limit: None, lambda self, c: self.sockets, None]
)
def test_another_rospy_stays_as_it_is(log, monkeypatch, changed):
    monkeypatch.setattr("rospy.topics._PublisherImpl.add_connection", changed)
    assert patches.active() == set(patches.PATCHES) - {"send_at_once"}
    assert log == [
        "this rospy differs from the tested one: sending takes a thread for each subscriber "
        "(rospy.topics:_PublisherImpl.add_connection changed)"
    ]
