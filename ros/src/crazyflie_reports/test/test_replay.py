"""The program replay: journals are run again and compared, and what is wrong with them is named."""

import io
import json
import os
import signal
import sys
import time
from queue import SimpleQueue

import pytest
from geometry_msgs.msg import PointStamped
from hypothesis import example, given
from hypothesis import strategies as st
from std_msgs.msg import Float64, String

from crazyflie_reports import replay_program
from crazyflie_reports.replay import Status, replay
from crazyflie_reports.replay_program import main
from crazyflie_utils import Node
from crazyflie_utils.journal import journal_file
from crazyflie_utils.journal.journal_file import Journal, JournalWriter, Kind
from crazyflie_utils.journal.recording import Recorder
from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import Number
from crazyflie_utils.testing import FakeGraph, FakeProcess
from crazyflie_utils.testing.programs import wait_until

END = "end"  #: A text upon which `DyingNode` dies.


class ScaleParameters(Parameters):
    """Parameters of the node."""

    gain: float = parameter(Number(), "gain", 2.0)


class ScaleNode(Node[ScaleParameters]):
    """Publishes a point for each number."""

    factor = 1.0
    is_silent = False

    def register_callbacks(self, handle):
        self.out = handle.publisher("/point", PointStamped)
        handle.subscribe("/number", Float64, self.on_number)
        handle.timer(0.1, self.on_timer)

    def on_number(self, message):
        point = PointStamped()
        point.header.stamp = self._handle.stamp()
        point.point.x = 1.0
        # From the sixth number on, the factor counts.
        factor = self.factor if message.data > 5.0 else 1.0
        point.point.y = self._parameters.gain * message.data * factor
        if not (self.is_silent and message.data > 5.0):
            self.out.publish(point)

    def on_timer(self):
        pass


class ListenNode(Node):
    """Receives the points when its timer looks."""

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        handle.subscribe("/point", PointStamped, self.on_point, latest_only=True)
        handle.timer(0.03, lambda: None)

    def on_point(self, message):
        self.last = message.point


class WaitingNode(Node):
    """Has a task that waits for something outside."""

    def __init__(self):
        self.answers = SimpleQueue()

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self.out = handle.publisher("/out", String)
        handle.task("wait", self.wait)

    def wait(self):
        for number in range(3):
            answer = self._handle.value("answer", self.answers.get, waits=True)
            self.out.publish(String(f"{number} {answer}"))


class DyingNode(Node):
    """Fails or dies upon a text."""

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self.out = handle.publisher("/out", String)
        handle.subscribe("/text", String, self.on_text)

    def on_text(self, message):
        self.out.publish(message)
        if message.data == END:
            self.die()

    def die(self):
        raise RuntimeError("as asked")


class SocketNode(DyingNode):
    """Reads more than its handle gives."""

    sources = "sockets"


@pytest.fixture
def folder(tmp_path):
    """Return the folder of the journals of a flight of both nodes."""
    graph = FakeGraph(
        {"/scale/gain": 3.0}, recorder=lambda name, time: recorder(tmp_path, name, time)
    )
    graph.start("/listen", ListenNode())
    graph.start("/scale", ScaleNode())
    for k in range(20):
        graph.publish("/number", Float64(0.5 * k))
        graph.advance(0.05)
    graph.end("/scale")
    graph.end("/listen")
    return tmp_path


def recorder(folder, node, time, keep=1e9, **header):
    fields = {"node": node, "program": "", "clock": "manual", "start": time, "us": 0, **header}
    path = folder / f"{node.strip('/')}.journal"
    return Recorder(JournalWriter(path, fields, keep, pytest.fail))


def run_program(capsys, *arguments):
    """Return the exit status, and what is printed."""
    status = main([str(each) for each in arguments])
    return status, capsys.readouterr().out


def test_journals_of_a_folder_are_run_side_by_side(folder, capsys):
    status, text = run_program(capsys, folder)
    assert status == 0
    first, second, last = text.splitlines()
    assert first.startswith("/listen: identical: ")
    assert second.startswith("/scale: identical: ")
    assert "20 messages" in second
    assert last.startswith("2 journals: 2 identical, 0 different, 0 not run to their ends, 0 not r")


def test_each_replay_prints_the_same_numbers(folder, capsys):
    texts = {run_program(capsys, folder)[1].split(";")[0] for _ in range(3)}
    assert len(texts) == 1


def test_a_difference_is_named_with_time_field_values_and_callback(folder, capsys, monkeypatch):
    monkeypatch.setattr(ScaleNode, "factor", 2.0)
    status, text = run_program(capsys, folder)
    assert status == 1
    assert "/listen: identical" in text
    assert "/scale: different" in text
    assert "other values are published on /point" in text
    # 11 numbers of up to 5.0 came before; 0.05 s between them.
    assert "ROS time 100.550000" in text
    assert "point.y: now 33.0; then 16.5, as /listen received it" in text
    assert "in ScaleNode.on_number of /scale, test_replay.py:" in text
    assert "a message on /number" in text


def test_the_value_of_then_is_in_the_journal_of_who_received_it(folder, monkeypatch):
    monkeypatch.setattr(ScaleNode, "factor", 2.0)
    outcome = replay(folder / "scale.journal")
    assert outcome.status is Status.DIFFERENT
    assert "then: not known; the journal of another process that received /point" in outcome.text
    assert "y: 33.0" in outcome.text


def test_a_message_that_is_missing_is_named_with_the_callback(folder, monkeypatch):
    monkeypatch.setattr(ScaleNode, "is_silent", True)
    outcome = replay(folder / "scale.journal")
    assert outcome.status is Status.DIFFERENT
    assert "now the callback has ended; then it published on /point" in outcome.text
    assert "at a message on /number" in outcome.text


def test_the_debugger_stops_in_the_callback_at_the_printed_time(folder, capsys, monkeypatch):
    monkeypatch.setattr(ScaleNode, "factor", 2.0)
    path = folder / "scale.journal"
    _, text = run_program(capsys, path)
    (line,) = [each for each in text.splitlines() if "--break-at" in each]
    # The last command leaves the debugger, in a callback whose exceptions are caught.
    monkeypatch.setattr(sys, "stdin", io.StringIO("p message.data\nq\n"))
    status, text = run_program(capsys, path, *line.split()[:2])
    assert status == 0
    assert "on_number()" in text
    assert "(Pdb) 5.5" in text
    assert "identical until the debugger was left" in text
    assert sys.gettrace() is None or "pdb" not in repr(sys.gettrace())


@pytest.mark.parametrize(
    ("moment", "shown"),
    [(0.0, "for number in range(3)"), (1.5, "1 second"), (2.5, "2 third")],
)
def test_the_debugger_stops_in_a_task(tmp_path, capsys, monkeypatch, moment, shown):
    """Where it begins, or where it goes on after it has waited."""
    node, process = WaitingNode(), FakeProcess(recorder=recorder(tmp_path, "/wait", 100.0))
    assert process.launch(node, "/wait")
    for k, text in enumerate(("first", "second", "third"), 1):
        process.advance(1.0)
        node.answers.put(text)
        wait_until(lambda k=k: len(process.published("/out")) == k, "the task")
    process.recorder.close()
    command = "n\np str(number), answer\n" if moment else ""
    monkeypatch.setattr(sys, "stdin", io.StringIO(f"{command}q\n"))
    status, text = run_program(capsys, tmp_path / "wait.journal", "--break-at", moment)
    assert status == 0
    assert "wait()" in text
    assert (repr(tuple(shown.split())) if moment else shown) in text
    assert "identical until the debugger was left" in text


def test_the_debugger_takes_one_journal(folder, capsys):
    with pytest.raises(SystemExit) as end:
        main([str(folder), "--break-at", "1.0"])
    assert end.value.code == 2
    assert "--break-at takes one journal, not 2" in capsys.readouterr().err


def test_the_log_is_printed_with_times(folder, capsys, monkeypatch):
    monkeypatch.setattr(
        ScaleNode, "on_timer", lambda self: self._handle.warn("as asked", throttle=0.35)
    )
    status, text = run_program(capsys, folder / "scale.journal", "--log")
    assert status == 0
    # The timer has 0.1 s.
    lines = [line.strip() for line in text.splitlines() if "as asked" in line]
    assert lines == [f"{time:.6f} s [warn] /scale: as asked" for time in (0.1, 0.5, 0.9)]


def test_a_profile_names_the_functions(folder, capsys):
    status, text = run_program(capsys, folder / "scale.journal", "--profile")
    assert status == 0
    assert "tottime" in text
    assert "replay_transport.py:" in text


def ending(folder, monkeypatch, die, times=3):
    """Return the journal of a process whose callback ends it in some way."""
    process = FakeProcess(recorder=recorder(folder, "/dying", 100.0))
    assert process.launch(DyingNode(), "/dying")
    for _ in range(times):
        process.publish("/text", String("go on"))
    # The callback does not return in a process that dies.
    monkeypatch.setattr(DyingNode, "die", lambda self: None)
    process.publish("/text", String(END))
    monkeypatch.setattr(DyingNode, "die", die)
    return folder / "dying.journal"


def test_an_exception_of_a_callback_happens_again_with_its_traceback(tmp_path, monkeypatch, capsys):
    path = ending(tmp_path, monkeypatch, DyingNode.die)
    status, text = run_program(capsys, path)
    assert status == 0
    assert "DyingNode.on_text failed" in text
    assert "RuntimeError: as asked" in text
    assert text.startswith("/dying: identical: 5 callbacks, 4 messages")


@pytest.mark.parametrize(
    ("die", "end"),
    [
        (lambda self: os._exit(3), "exited with status 3"),
        (lambda self: os.kill(os.getpid(), signal.SIGKILL), "died by SIGKILL"),
    ],
    ids=["_exit", "SIGKILL"],
)
def test_a_process_dies_again_in_its_last_callback(tmp_path, monkeypatch, capsys, die, end):
    path = ending(tmp_path, monkeypatch, die)
    status, text = run_program(capsys, path)
    assert status == 0
    assert text.startswith(f"/dying: identical up to its last callback, where it {end} again")
    assert "in callback 5" in text


def test_a_process_that_dies_only_now_is_a_difference(tmp_path, monkeypatch, capsys):
    path = ending(tmp_path, monkeypatch, DyingNode.die)
    monkeypatch.setattr(DyingNode, "on_text", lambda self, message: os._exit(3))
    status, text = run_program(capsys, path)
    assert status == 1
    assert "different: now it exited with status 3 at 0." in text or "now it exited" in text
    assert "in callback 2; then it had 5 callbacks" in text


def test_a_callback_that_ends_its_thread_does_so_again(tmp_path, monkeypatch):
    path = ending(tmp_path, monkeypatch, lambda self: sys.exit("as asked"))
    outcome = replay(path)
    assert outcome.status is Status.IDENTICAL
    assert "SystemExit: as asked" in outcome.text


def test_a_process_that_was_killed_in_a_callback_is_run_up_to_there(tmp_path, monkeypatch):
    path = ending(tmp_path, monkeypatch, lambda self: self.out.publish(String("more")))
    outcome = replay(path)
    assert outcome.status is Status.IDENTICAL
    assert "the journal ends in DyingNode.on_text of /dying" in outcome.text


def test_a_callback_that_does_not_return_is_ended(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(replay_program, "_LIMIT", 0.5)

    def wait(self):
        while True:
            signal.pause()

    status, text = run_program(capsys, ending(tmp_path, monkeypatch, wait))
    assert status == 0
    assert "did not return from a callback within 0.5 s again" in text


def test_the_search_for_the_value_of_then_is_no_callback(folder, monkeypatch, capsys):
    """It may take longer: one journal after the other is read."""
    monkeypatch.setattr(ScaleNode, "factor", 2.0)
    for k in range(40):
        (folder / f"other{k}.journal").write_bytes((folder / "listen.journal").read_bytes())

    def slow(journals, *_):
        for _ in journals:
            time.sleep(0.05)

    monkeypatch.setattr(replay_program, "_LIMIT", 1.0)
    monkeypatch.setattr("crazyflie_reports.replay.received_value", slow)
    status, text = run_program(capsys, folder / "scale.journal")
    assert status == 1
    assert "other values are published on /point" in text


def test_a_node_that_was_not_initialized_is_refused_again(tmp_path):
    """As of a process of ROS, whose main program ends then."""
    own = recorder(tmp_path, "/scale", 0.0, clock="steady", program="test_replay:ScaleNode")
    own.row(Kind.VALUE, 0, 0, json.dumps(["/scale", True, {"gain": "a lot"}]).encode())
    outcome = replay(tmp_path / "scale.journal")
    assert outcome.status is Status.IDENTICAL
    assert "/scale/gain is 'a lot'" in outcome.text
    assert "it ends, since it is not initialized" in outcome.text


def test_a_parameter_that_is_new_has_its_default(folder, monkeypatch):
    class NewParameters(ScaleParameters):
        more: float = parameter(Number(), "another", 1.0)

    monkeypatch.setattr(ScaleNode, "parameters_type", NewParameters)
    assert replay(folder / "scale.journal").status is Status.IDENTICAL


def test_a_parameter_of_another_node_that_is_new_is_named(folder, monkeypatch):
    load = ScaleNode.load_parameters

    def load_more(self, handle):
        load(self, handle)
        handle.get_param("/other/mass", Number(), 1.0)

    monkeypatch.setattr(ScaleNode, "load_parameters", load_more)
    outcome = replay(folder / "scale.journal")
    assert outcome.status is Status.DIFFERENT
    assert "now it reads the parameter /other/mass; then" in outcome.text
    assert "test_replay.py:" in outcome.text
    assert "at launch" in outcome.text


def test_a_class_that_is_gone_is_named_and_the_others_are_run(folder, monkeypatch, capsys):
    monkeypatch.delattr(sys.modules[__name__], "ScaleNode")
    status, text = run_program(capsys, folder)
    assert status == 2
    assert "there is no test_replay:ScaleNode any more" in text
    assert "/listen: identical" in text


def test_a_node_that_reads_sockets_is_named_and_does_not_count(folder, capsys):
    """As the driver in the journals of a flight of a real vehicle."""
    header = {"clock": "steady", "program": "test_replay:SocketNode"}
    recorder(folder, "/socket", 0.0, **header).close()
    status, text = run_program(capsys, folder)
    assert status == 0
    assert "/socket reads sockets" in text
    assert "2 identical, 0 different, 0 not run to their ends, 1 not repeatable" in text
    status, _ = run_program(capsys, folder / "socket.journal")
    assert status == 2


def test_a_cut_journal_is_compared_up_to_the_cut(folder, capsys):
    path = folder / "scale.journal"
    content = path.read_bytes()
    path.write_bytes(content[:-5])
    status, text = run_program(capsys, path)
    assert status == 2
    assert "identical so far, and then not known" in text
    assert "is damaged or cut" in text


_DATA = st.one_of(
    st.binary(max_size=20),
    st.sampled_from([b"5", b"[]", b"null", b'[[["a"], 1], 2]', b"[" * 100_000]),
    st.lists(st.sampled_from(["/scale", "/point", "std_msgs/Float64", True, 3, None])).map(
        lambda each: json.dumps(each).encode()
    ),
)


@given(
    st.lists(st.tuples(st.sampled_from(Kind), st.integers(0, 3), st.integers(0, 3), _DATA)),
    st.integers(0, 30),
)
@example([(Kind.WALL, 0, 0, b"")], 1)
@example([(Kind.CLOCK, 1, 0, b"too long for a number")], 1)
def test_a_journal_into_which_anything_was_written_ends_with_an_outcome(
    tmp_path_factory, rows, begin
):
    path = tmp_path_factory.mktemp("hostile") / "scale.journal"
    process = FakeProcess(recorder=recorder(path.parent, "/scale", 100.0))
    assert process.launch(ScaleNode(), "/scale")
    for k in range(20):
        process.publish("/number", Float64(k))
    process.recorder.close()
    journal = Journal(path)
    good = list(journal.rows())
    writer = JournalWriter(path, journal.header, 1e9, pytest.fail)
    for row in [*good[:begin], *rows, *good[begin:]]:
        kind, number, value, data = row
        writer.row(kind, number, value, data)
    writer.close()
    outcome = replay(path)
    assert outcome.text.startswith(("/scale: ", str(path)))
    assert rows or outcome.status is Status.IDENTICAL


def test_rows_that_do_not_fit_are_named(tmp_path, capsys):
    own = recorder(tmp_path, "/scale", 100.0)
    assert FakeProcess(recorder=own).launch(ScaleNode(), "/scale")
    own.row(Kind.MESSAGE, 7, 0, b"1234")
    own.close()
    status, text = run_program(capsys, tmp_path)
    assert status == 2
    assert "MESSAGE 7 does not fit these nodes" in text


def test_a_journal_without_its_older_part_says_what_is_left(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(journal_file, "_LONGEST", 0.0)
    monkeypatch.setattr(journal_file, "_FULL", 0)
    monkeypatch.setattr(journal_file, "_MAX_BACKLOG", 1000)
    own = recorder(tmp_path, "/scale", 100.0, keep=0.0)
    process = FakeProcess(recorder=own)
    assert process.launch(ScaleNode(), "/scale")
    process.recorder.end_start()
    for k in range(200):
        process.publish("/number", Float64(k))
    own.close()
    damaged = Journal(tmp_path / "scale.journal")
    assert len(list(damaged.rows())) < 200
    status, text = run_program(capsys, tmp_path)
    assert status == 2
    assert "older ones were dropped" in text
    assert "CRAZYFLIE_JOURNAL_MINUTES" in text


@pytest.mark.parametrize("name", ["nowhere", "empty"])
def test_what_is_no_journal_is_named(tmp_path, capsys, name):
    (tmp_path / "empty").mkdir()
    with pytest.raises(SystemExit) as end:
        main([str(tmp_path / name)])
    assert end.value.code == 2
    assert f"{name}: no " in capsys.readouterr().err


def test_a_bag_is_no_journal(tmp_path, capsys):
    (tmp_path / "a.bag").write_bytes(b"#ROSBAG V2.0\n")
    status, text = run_program(capsys, tmp_path / "a.bag")
    assert status == 2
    assert "a.bag is not a journal" in text
