"""The program journal prints what a journal has."""

import os
import subprocess
import sys

import pytest
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

from crazyflie_reports.journal_program import main
from crazyflie_utils import Node
from crazyflie_utils.journal.journal_file import Journal, JournalWriter, Kind
from crazyflie_utils.journal.recording import Recorder
from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import Number
from crazyflie_utils.testing import FakeGraph


class EchoParameters(Parameters):
    """Parameters of the node."""

    gain: float = parameter(Number(), "gain", 2.0)


class EchoNode(Node[EchoParameters]):
    """Publishes numbers as text."""

    def register_callbacks(self, handle):
        self.text = handle.publisher("/text", String)
        handle.advertise_service("/set", SetBool, lambda request: SetBoolResponse(True, ""))
        handle.subscribe("/number", Float64, lambda message: self.text.publish(String("got")))


@pytest.fixture
def path(tmp_path):
    """Return the journal of a process that gets three numbers, and a call after 2 s."""
    path = tmp_path / "echo.journal"
    header = {"node": "/echo", "program": "", "clock": "manual", "start": 100.0, "us": 0}
    writer = JournalWriter(path, {**header, "began": "2026-11-29T12:00:00+01:00"}, 1e9, pytest.fail)
    graph = FakeGraph({"/echo/gain": 3.0}, recorder=lambda name, time: Recorder(writer))
    graph.start("/echo", EchoNode())
    for k in range(3):
        graph.publish("/number", Float64(k), caller=("/lab", "/lab", "/stranger")[k])
        graph.advance(0.1)
    graph.advance(2.0)
    writer.row(Kind.SUBMITTED, 0, 0, b'["/echo", "LogTopics.publish", "(1,)"]')
    graph.call("/set", SetBoolRequest(True))
    graph.end("/echo")
    return path


def test_what_a_journal_has_is_printed(path, capsys):
    assert main([str(path)]) == 0
    text = capsys.readouterr().out
    for line in (
        "began 2026-11-29 12:00:00+01:00",
        '/echo: {"gain": 3.0}',
        "/number (std_msgs/Float64): 3, 1.3 Hz, from /lab (2, 0.00 to 0.10 s), "
        "/stranger (1, 0.20 to 0.20 s)",
        "/text (std_msgs/String): 3, 1.3 Hz",
        "/set (std_srvs/SetBool): 1",
        "2.300000 s /set data: True",
        "more than 0.5 s without an input:\n  0.300 s to 2.300 s",
        "called by threads, which cannot be run again:\n  LogTopics.publish: 1",
    ):
        assert line in text


def test_long_gaps_of_a_publisher_are_told(tmp_path, capsys):
    path = tmp_path / "echo.journal"
    header = {"node": "/echo", "program": "", "clock": "manual", "start": 100.0, "us": 0}
    writer = JournalWriter(path, header, 1e9, pytest.fail)
    graph = FakeGraph({}, recorder=lambda name, time: Recorder(writer))
    graph.start("/echo", EchoNode())
    for k in range(40):
        graph.publish("/number", Float64(k), caller="/lab")
        graph.advance(1.2 if k == 29 else 0.02)
    graph.end("/echo")
    assert main([str(path)]) == 0
    text = capsys.readouterr().out
    assert "from /lab (40, 0.00 to 1.96 s, none for 1.20 s before 1.78 s)" in text


def test_messages_of_a_topic_are_printed_with_times_and_senders(path, capsys):
    assert main([str(path), "--topic", "/number"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "0.000000 s /lab: data: 0.0",
        "0.100000 s /lab: data: 1.0",
        "0.200000 s /stranger: data: 2.0",
    ]


@pytest.mark.parametrize(
    ("change", "arguments", "reason"),
    [
        (
            lambda data: data,
            ["--topic", "/numbers"],
            "no message on /numbers; its subscriptions: /clock, /number",
        ),
        (lambda data: b"#ROSBAG", [], "is not a journal"),
        (lambda data: data.replace(b'"node": "/echo"', b'"node": 1'), [], "node is 1"),
    ],
)
def test_what_cannot_be_printed_is_named(path, capsys, change, arguments, reason):
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(SystemExit) as end:
        main([str(path), *arguments])
    assert end.value.code == 2
    assert reason in capsys.readouterr().err


def test_a_reader_that_wants_no_more_is_no_error(path):
    """As ``journal JOURNAL --topic NAME | head`` is."""
    read, write = os.pipe()
    os.close(read)
    program = "import sys; from crazyflie_reports.journal_program import main; sys.exit(main())"
    command = [sys.executable, "-c", program, str(path), "--topic", "/number"]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, timeout=60, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_cut_journal_is_printed_to_the_cut(path, capsys):
    data = path.read_bytes()
    path.write_bytes(data[:-5])
    assert main([str(path)]) == 0
    assert "is damaged or cut" in capsys.readouterr().out
    assert Journal(path).header["node"] == "/echo"
