"""Rows of a journal that say less than they should are left out, and counted."""

import json
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import pytest
from std_msgs.msg import Float32, String

from crazyflie_reports.flight_input import _JournalInput, of_journals
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


@pytest.fixture
def given():
    return _JournalInput(SimpleNamespace(header=HEADER, path=Path("node.journal")))


def named(number, topic, datatype):
    return Row(Kind.SUBSCRIBED, number, 0, json.dumps([topic, datatype]).encode())


def test_messages_of_a_topic_that_a_thread_has_subscribed_to_are_counted(given):
    given.take(named(1, "/text", "std_msgs/String"))
    given.take(Row(Kind.MESSAGE, 1, 0, packed(String("hello"))))
    given.take(Row(Kind.MESSAGE, 4, 0, packed(String("from a driver"))))
    given.take(Row(Kind.CALL, 7, 0))
    assert [(topic, len(messages)) for topic, messages in given.series()] == [("/text", 1)]
    assert given.unnamed == 2


def test_messages_of_another_version_of_their_type_are_named(given):
    given.take(named(1, "/number", "std_msgs/Float64"))
    given.take(Row(Kind.MESSAGE, 1, 0, packed(Float32(1.5))))
    assert list(given.series()) == []
    assert given.outdated == {"/number": "std_msgs/Float64"}


def test_a_row_that_is_no_row_is_damage(given):
    with pytest.raises(JournalError, match="node.journal: a SUBSCRIBED cannot be read"):
        given.take(Row(Kind.SUBSCRIBED, 1, 0, b"{"))


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
