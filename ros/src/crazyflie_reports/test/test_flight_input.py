"""Rows of a journal that say less than they should are left out, and counted."""

import json
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import pytest
from std_msgs.msg import Float32, String

from crazyflie_reports.flight_input import FlightInput, InputError, _JournalInput, of_journals
from crazyflie_reports.rerun import interface, remove_effects
from crazyflie_utils.journal.journal_file import ORIGIN, JournalError, JournalWriter, Kind, Row
from crazyflie_utils.node import Node

HEADER = {"clock": "steady", "us": 0, "start": 0.0, "node": "/node"}


class SocketNode(Node):
    """Reads more than its handle gives."""

    sources = "sockets"


def packed(message):
    buffer = BytesIO()
    message.serialize(buffer)
    return ORIGIN.pack(0) + buffer.getvalue()


def given(*rows):
    journal = SimpleNamespace(header=HEADER, path=Path("node.journal"), rows=lambda: iter(rows))
    return _JournalInput(journal)


def named(number, topic, datatype):
    return Row(Kind.SUBSCRIBED, number, 0, json.dumps([topic, datatype]).encode())


def test_messages_of_a_topic_that_a_thread_has_subscribed_to_are_counted():
    found = given(
        named(1, "/text", "std_msgs/String"),
        Row(Kind.MESSAGE, 1, 0, packed(String("hello"))),
        Row(Kind.MESSAGE, 4, 0, packed(String("from a driver"))),
        Row(Kind.CALL, 7, 0),
    )
    assert [(topic, len(messages)) for topic, messages in found.series()] == [("/text", 1)]
    assert found.unnamed == 2


def test_messages_of_another_version_of_their_type_are_named():
    found = given(
        named(1, "/number", "std_msgs/Float64"), Row(Kind.MESSAGE, 1, 0, packed(Float32(1.5)))
    )
    assert list(found.series()) == []
    assert found.outdated == {"/number": "std_msgs/Float64"}


@pytest.mark.parametrize(
    ("row", "text"),
    [
        (Row(Kind.SUBSCRIBED, 1, 0, b"{"), "a SUBSCRIBED is not two names in JSON"),
        (Row(Kind.VALUE, 0, 0, b"{"), "a VALUE cannot be read"),
        (Row(Kind.WALL, 0, 0, b"123"), "a WALL cannot be read"),
    ],
)
def test_a_row_that_is_no_row_is_damage(row, text):
    with pytest.raises(JournalError, match=f"node.journal: {text}"):
        given(row)


def test_what_a_node_with_sources_published_is_not_known(tmp_path):
    header = {**HEADER, "program": f"{__name__}:SocketNode"}
    writer = JournalWriter(tmp_path / "node.journal", header, 1e9, pytest.fail)
    writer.row(Kind.SUBSCRIBED, 1, 0, b'["/text", "std_msgs/String"]')
    writer.row(Kind.MESSAGE, 1, 0, packed(String("hello")))
    writer.close()
    found = of_journals([tmp_path / "node.journal"])
    assert [each.topic for each in found.messages] == ["/text"]
    (remark,) = found.remarks
    assert remark.startswith("what it published is not known: ")
    assert "/node reads sockets" in remark


class MovingNode(SocketNode):
    """A node that would move something."""

    sources, effects = "", "vehicles"


def test_a_node_that_acts_on_vehicles_is_not_run_on_a_recording():
    """Given the recorded call that adds a vehicle, a driver would connect to it."""
    found = FlightInput([], {}, {"/a": f"{__name__}:MovingNode", "/b": "gone.module:Node"})
    with pytest.raises(InputError, match="the node /a acts on vehicles: it is not run again"):
        interface("/a", found)
    remove_effects(found)
    assert list(found.classes) == ["/b"]
    assert found.remarks == ["/a is not run again: it acts on vehicles"]
