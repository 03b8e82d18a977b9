"""Journals: what a process was given is written, and gives the same when it is run again."""

import errno
import json
import sys
import threading
from concurrent.futures import Future

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped
from hypothesis import given
from hypothesis import strategies as st
from std_msgs.msg import Empty, Float32, Float64, Header, String
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse, Trigger, TriggerRequest

from crazyflie_utils import Node
from crazyflie_utils.journal import journal_file
from crazyflie_utils.journal.journal_file import (
    UNCHECKED,
    Journal,
    JournalError,
    JournalWriter,
    Kind,
    Row,
)
from crazyflie_utils.journal.recording import Recorder
from crazyflie_utils.journal.replay import Replay
from crazyflie_utils.journal.replay_transport import DifferenceError, EndError
from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import Number
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.testing.fake_transport import FakeTransport

HEADER = {"node": "/mean", "program": "", "clock": "manual", "start": 100.0, "us": 0}


class MeanParameters(Parameters):
    """Parameters of the node."""

    gain: float = parameter(Number(), "gain", 2.0, live=True)


class MeanNode(Node[MeanParameters]):
    """Uses each kind of input."""

    factor = 1.0

    def __init__(self):
        self.last = 0.0
        self.count = 0

    def register_callbacks(self, handle):
        self.out = handle.publisher("/out", Float64)
        self.text = handle.publisher("/text", String, latch=True)
        handle.advertise_service("/set", SetBool, self.on_set)
        handle.subscribe("/in", Float64, self.on_in)
        handle.subscribe("/latest", Float64, self.on_latest, latest_only=True)
        handle.subscribe("/fail", Empty, self.on_fail)
        handle.timer(0.1, self.on_timer)
        handle.timer(0.25, self.on_steady, steady=True)

    def on_in(self, message):
        self.count += 1
        self.last = self.factor * self._parameters.gain * message.data
        self.out.publish(Float64(self.last + self._handle.time()))

    def on_latest(self, message):
        self.last += message.data

    def on_timer(self):
        self._handle.warn("again", throttle=0.25)
        if self.out.has_subscribers():
            self.out.publish(Float64(self.last))

    def on_steady(self):
        self.text.publish(String(f"{self.count} {self._handle.stamp().to_sec():.3f}"))

    def on_set(self, request):
        asked = self._handle.call_service("/other", Trigger, TriggerRequest(), 1.0)
        asked.add_done_callback(lambda done: self.text.publish(String(str(done.exception()))))
        return SetBoolResponse(request.data, f"{self.count}")

    def on_fail(self, _):
        raise RuntimeError("as asked")


def fly(path, report=print, keep=1e9):
    """Record a process that is given a bit of everything; it is not ended."""
    recorder = Recorder(JournalWriter(path, HEADER, keep, report))
    process = FakeProcess({"/mean/gain": 3.0}, recorder=recorder)
    assert process.launch(MeanNode(), "/mean")
    for k in range(20):
        process.publish("/in", Float64(0.1 * k))
        process.publish("/latest", Float64(k))
        process.advance(0.03)
        if k == 7:
            assert process.call("/set", SetBoolRequest(True)).message == "8"
        if k == 10:
            process.reconfigure("/mean", gain=4.0)
        if k == 12:
            process.publish("/fail", Empty())
        if k == 15:
            process.clock.wall_offset = 5.0
    return process


@pytest.fixture
def path(tmp_path):
    return tmp_path / "mean.journal"


@pytest.fixture
def recorded(path):
    process = fly(path)
    process.recorder.close()
    return path


def run(replay):
    """Run a replay to its end; return whether its nodes were initialized."""
    if not replay.start():
        return False
    while replay.step():
        pass
    return True


def run_again(path):
    """Return the replay of a journal, run to its end, what was published and logged."""
    with Replay(Journal(path)) as replay:
        replay.published, replay.logged = [], []
        publish, log = replay.published.append, replay.logged.append
        replay.transport.on_publish = lambda topic, message: publish((topic, message))
        replay.transport.on_log = lambda level, text: log((level, text))
        assert run(replay)
    return replay


def test_a_replay_publishes_the_same(path):
    process = fly(path)
    process.recorder.close()
    replay = run_again(path)
    for topic in ("/out", "/text"):
        again = [message for name, message in replay.published if name == topic]
        assert again == process.published(topic)
    assert len(again) > 2
    # Also by the clock of then: some warnings come at most once in a while.
    assert replay.logged == process.transport.log_records
    assert replay.journal.damage == ""
    assert replay.nodes["/mean"].count == 20
    assert not (path.parent / "mean.journal.tail").exists()


class PeersNode(Node):
    """Tells whether somebody publishes."""

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self.text = handle.publisher("/text", String)
        self.handle = handle.child()
        self.subscriber = self.handle.subscribe("/in", Float64, lambda message: None)
        handle.timer(0.1, self.on_timer)
        handle.timer(1.0, self.handle.close)

    def on_timer(self):
        self.text.publish(String(str(self.subscriber.has_publishers())))


def test_publishers_that_come_and_go_are_seen_again(path):
    recorder = Recorder(JournalWriter(path, HEADER, 1e9, print))
    process = FakeProcess(recorder=recorder)
    assert process.launch(PeersNode(), "/peers")
    process.advance(0.35)
    process.transport.unpublished.add("/in")
    process.advance(1.0)
    recorder.close()
    told = [message.data for message in process.published("/text")]
    assert told == ["True"] * 3 + ["False"] * 10
    again = [message.data for _, message in run_again(path).published]
    assert again == told


class DigitsNode(Node):
    """Publishes as text what it is given."""

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self.text = handle.publisher("/text", String)
        handle.advertise_service("/set", SetBool, self.on_set)
        handle.subscribe("/in", Float32, lambda message: self.tell(message.data))
        handle.timer(0.1, self.on_timer)

    def tell(self, value):
        self.text.publish(String(repr(value)))

    def on_set(self, request):
        self.tell(request.data)
        return SetBoolResponse()

    def on_timer(self):
        asked = self._handle.call_service("/other", SetBool, SetBoolRequest(), 1.0)
        asked.add_done_callback(lambda done: self.tell(done.result().success))


def test_nodes_are_given_the_digits_that_are_written(path):
    """Those of a float32 are fewer; a bool on the wire is not a number."""
    recorder = Recorder(JournalWriter(path, HEADER, 1e9, print))
    process = FakeProcess(recorder=recorder)
    assert process.launch(DigitsNode(), "/digits")
    answer = Future()
    answer.set_result(SetBoolResponse(success=1))
    process.transport.services["/other"] = lambda request: answer
    process.publish("/in", Float32(0.1))
    process.call("/set", SetBoolRequest(1))
    process.advance(0.1)
    recorder.close()
    told = [message.data for message in process.published("/text")]
    assert [message.data for _, message in run_again(path).published] == told
    assert told == [repr(float(np.float32(0.1))), "True", "True"]


class LatestNode(Node):
    """Tells what was the latest message when it is asked, and by its timer."""

    def __init__(self):
        self.latest = 0.0

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self.text = handle.publisher("/text", String)
        handle.advertise_service("/ask", Trigger, lambda _: self.tell("asked"))
        handle.subscribe("/in", Float64, self.on_in, latest_only=True)
        handle.timer(0.1, lambda: self.tell("timer"), steady=True)

    def on_in(self, message):
        self.latest = message.data

    def tell(self, why):
        self.text.publish(String(f"{why} {self.latest:g}"))


class SocketTransport(FakeTransport):
    """Messages wait until they are collected."""

    def __init__(self):
        super().__init__({})
        self.waiting = []

    def collect(self):
        while self.waiting:
            self.deliver("/in", Float64(self.waiting.pop(0)))


@pytest.mark.parametrize("has_journal", [False, True])
def test_messages_that_wait_come_before_calls_and_timers(path, has_journal):
    recorder = Recorder(JournalWriter(path, HEADER, 1e9, print)) if has_journal else None
    transport = SocketTransport()
    process = FakeProcess(transport=transport, recorder=recorder)
    assert process.launch(LatestNode(), "/latest")
    transport.waiting += [1.0, 2.0]
    process.call("/ask", TriggerRequest())
    transport.waiting += [3.0, 4.0]
    process.advance(0.1)
    told = [message.data for message in process.published("/text")]
    assert told == ["asked 2", "timer 4"]
    if recorder is not None:
        recorder.close()
        replay = run_again(path)
        assert [message.data for _, message in replay.published] == told
        assert replay.rows.counts[Kind.MESSAGE] == 4


class OddNode(Node):
    """Publishes a message that cannot be sent, and one without a frame."""

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self.text = handle.publisher("/text", String)
        self.point = handle.publisher("/point", PointStamped)
        handle.timer(0.1, self.on_timer)

    def on_timer(self):
        self.point.publish(PointStamped(header=Header(frame_id=None)))
        self.text.publish(String(5))

    def enter_safe_state(self):
        self.text.publish(String("safe"))


def test_messages_that_cannot_be_sent_fail_again(path):
    recorder = Recorder(JournalWriter(path, HEADER, 1e9, print))
    process = FakeProcess(recorder=recorder)
    assert process.launch(OddNode(), "/odd")
    process.advance(0.1)
    recorder.close()
    [error] = process.logged("error")
    replay = run_again(path)
    assert [text.splitlines()[-1] for level, text in replay.logged if level == "error"] == [
        error.splitlines()[-1]
    ]
    assert [topic for topic, _ in replay.published] == ["/point", "/text"]


def test_what_a_thread_registers_has_its_name(path):
    """As a driver's topics, which its jobs register while other callbacks run."""
    recorder = Recorder(JournalWriter(path, HEADER, 1e9, print))
    process = FakeProcess(recorder=recorder)

    def register():
        handle = process.handle("/thread")
        text = handle.publisher("/late/text", String)
        handle.subscribe("/late/in", Float64, lambda message: text.publish(String("got")))

    thread = threading.Thread(target=register)
    # It does not wait for the turn of callbacks.
    process.executor.submit(lambda: (thread.start(), thread.join()))
    process.publish("/late/in", Float64(1.0))
    recorder.close()
    names, seen = {}, []
    for row in Journal(path).rows():
        if row.kind in (Kind.SUBSCRIBED, Kind.ADVERTISED):
            names[row.kind, row.number] = json.loads(row.data)[0]
        elif row.kind is Kind.MESSAGE:
            seen.append(names[Kind.SUBSCRIBED, row.number])
        elif row.kind is Kind.PUBLISHED:
            seen.append(names[Kind.ADVERTISED, row.number])
    assert seen == ["/late/in", "/late/text"]


def test_other_code_is_found_with_time_and_callback(recorded, monkeypatch):
    monkeypatch.setattr(MeanNode, "factor", 1.001)
    with (
        Replay(Journal(recorded)) as replay,
        pytest.raises(DifferenceError, match="other values are published on /out"),
    ):
        run(replay)
    # The first message that is not zero.
    assert replay.input_name == "a message on /in"
    assert replay.process.clock.time() == pytest.approx(100.03)


def test_other_topics_are_named(recorded, monkeypatch):
    register = MeanNode.register_callbacks

    def with_one_more(self, handle):
        handle.publisher("/more", Float64)
        register(self, handle)

    monkeypatch.setattr(MeanNode, "register_callbacks", with_one_more)
    with (
        Replay(Journal(recorded)) as replay,
        pytest.raises(DifferenceError, match="advertised now: .*/more.*; then: .*/out"),
    ):
        run(replay)


def test_a_process_that_was_killed_is_run_up_to_its_last_callback(path):
    process = fly(path)
    # Nothing was written but the tail in memory, which outlives the process.
    assert path.stat().st_size < 1000
    replay = run_again(path)
    assert replay.nodes["/mean"].count == 20
    again = [message for topic, message in replay.published if topic == "/out"]
    assert again == process.published("/out")


@pytest.mark.parametrize("is_before", [True, False])
def test_a_journal_of_a_process_that_runs_lacks_nothing(path, monkeypatch, is_before):
    process = fly(path)
    read_bytes = type(path).read_bytes

    def read_tail(self):
        # Rows are moved from the tail to the file.
        if is_before:
            process.recorder.close()
        content = read_bytes(self)
        process.recorder.close()
        return content

    monkeypatch.setattr(type(path), "read_bytes", read_tail)
    assert run_again(path).nodes["/mean"].count == 20


def test_a_fault_happens_again(recorded):
    (fault,) = (text for level, text in run_again(recorded).logged if level == "error")
    assert "RuntimeError: as asked" in fault


@given(st.floats(0.0, 1.0), st.integers(0, 255))
def test_a_damaged_journal_is_read_to_the_damage(tmp_path_factory, place, change):
    folder = tmp_path_factory.mktemp("damaged")
    fly(folder / "whole.journal").recorder.close()
    content = bytearray((folder / "whole.journal").read_bytes())
    header, at = content.index(b"\n"), round(place * (len(content) - 1))
    if change:
        content[at] ^= change
    else:
        del content[at:]
    path = folder / "damaged.journal"
    path.write_bytes(content)
    try:
        with Replay(Journal(path)) as replay:
            run(replay)
    except (JournalError, EndError):
        return
    except DifferenceError:
        # Only the header is not covered by a checksum.
        assert at <= header
        return
    # A cut may be between two chunks.
    assert replay.journal.damage or at <= header or not change


@given(st.lists(st.tuples(st.sampled_from(Kind), st.integers(0, 5), st.binary(max_size=40))))
def test_a_mixed_up_journal_is_refused_and_runs_nothing_of_its_own(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("hostile") / "hostile.journal"
    writer = JournalWriter(path, HEADER, 1e9, print)
    launch = json.dumps(["/mean", "os:abort"]).encode()
    for kind, number, data in rows:
        writer.row(kind, number, 0, data)
    writer.row(Kind.LAUNCH, 0, 0, launch)
    writer.close()
    with (
        pytest.raises((JournalError, DifferenceError, EndError)),
        Replay(Journal(path)) as replay,
    ):
        run(replay)


#: Kinds whose data are a number.
NUMBERS = Kind.TIME, Kind.WALL, Kind.CLOCK
ROWS = st.tuples(
    st.sampled_from([kind for kind in Kind if kind not in (Kind.CHECKED, *NUMBERS)]),
    st.integers(0, 2),
    st.integers(0, 0xFFFFFFFF),
    st.sampled_from([b"", b"1234", b"1235", b"0" * 300, bytes(range(256))]),
)


@given(st.lists(ROWS), st.booleans())
def test_rows_are_read_as_they_were_written(tmp_path_factory, rows, is_ended):
    path = tmp_path_factory.mktemp("rows") / "any.journal"
    writer = JournalWriter(path, HEADER, 1e9, print)
    for kind, number, value, data in rows:
        writer.row(kind, number, value, data)
    if is_ended:
        writer.close()
    # Without a check, the value of a message is not known.
    expected = [
        Row(kind, number, UNCHECKED if kind is Kind.PUBLISHED else value, data)
        for kind, number, value, data in rows
    ]
    assert list(Journal(path).rows()) == expected


@pytest.mark.parametrize("kind", NUMBERS)
@pytest.mark.parametrize("is_ended", [False, True])
def test_a_number_of_another_size_is_damage(path, kind, is_ended):
    writer = JournalWriter(path, HEADER, 1e9, print)
    writer.row(kind, 0, 0, b"12345678")
    writer.row(kind, 0, 0, b"123")
    if is_ended:
        writer.close()
    journal = Journal(path)
    assert [each.data for each in journal.rows()] == [b"12345678"]
    assert journal.damage == "a row is damaged"


@pytest.mark.parametrize(
    "program",
    [
        *("os:abort", "subprocess:run", "no_such_module:Node", "os"),
        # These act when they are imported: on the browser, and the terminal.
        *("antigravity:geohash", "this:s", "unittest.__main__:main"),
    ],
)
def test_only_nodes_are_made(path, program):
    module = program.partition(":")[0]
    was_loaded = module in sys.modules
    JournalWriter(path, {**HEADER, "clock": "steady", "program": program}, 1.0, print).close()
    with pytest.raises(JournalError, match=program), Replay(Journal(path)) as replay:
        run(replay)
    assert (module in sys.modules) is was_loaded


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is not a journal"),
        (b"#ROSBAG V2.0\n", "is not a journal"),
        (b'{"format": "crazyflie journal 99"}\n', "crazyflie journal 99"),
        (b'{"format": "crazyflie journal 3", "node": 3}\n', "node is 3; expected str"),
        (
            json.dumps({"format": journal_file.FORMAT, **HEADER, "clock": "odd"}).encode() + b"\n",
            "clock is 'odd'; expected steady, simulated or manual",
        ),
    ],
)
def test_what_is_no_journal_is_named(path, content, reason):
    path.write_bytes(content)
    with pytest.raises(JournalError, match=reason):
        Journal(path)


def test_a_full_disk_ends_the_journal_and_not_the_process(path, monkeypatch):
    reports = []

    def no_space(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(JournalWriter, "_write", no_space)
    process = fly(path, reports.append)
    process.recorder._writer._finish(0.0)
    process.recorder._writer._chunks.put((0, b"", b"", None, 0.0))
    process.recorder._writer._thread.join(5.0)
    assert len(reports) == 1
    assert "No space left on device" in reports[0]
    before = len(process.published("/out"))
    process.publish("/in", Float64(1.0))
    assert len(process.published("/out")) == before + 1


def test_a_journal_that_cannot_be_begun_says_why(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(JournalError, match="file/a.journal cannot be written"):
        JournalWriter(tmp_path / "file" / "a.journal", HEADER, 1.0, print)


def test_the_start_and_the_newest_rows_are_kept(path, monkeypatch):
    monkeypatch.setattr(journal_file, "_MAX_BACKLOG", 1000)
    writer = JournalWriter(path, HEADER, 60.0, print)
    writer.row(Kind.VALUE, 0, 0, b'["a", true, 1]')
    writer.end_start()
    for second in range(1, 1001):
        writer.pause(float(second))
        writer.row(Kind.TIMERS, 0, second)
    writer.close()
    journal = Journal(path)
    chunks = list(journal._chunks())
    rows = [row for _, content, _ in chunks for row in journal_file._rows(content)]
    values = [row.value for row in rows[1:]]
    assert rows[0].data == b'["a", true, 1]'
    assert values[-1] == 1000
    assert 60 <= len(values) <= 120
    assert len(list(journal.rows())) == 1
    assert "older ones were dropped" in journal.damage


@pytest.mark.parametrize("size", [0, 10, 0xFFFE, 0xFFFF, 200_000, 1_000_000])
def test_rows_of_any_size(path, size):
    writer = JournalWriter(path, HEADER, 1e9, print)
    data = [bytes([k]) * size for k in (1, 2, 3)]
    for each in data:
        writer.row(Kind.MESSAGE, 7, 9, each)
        writer.row(Kind.TIMERS, 0, 1)
    writer.close()
    rows = list(Journal(path).rows())
    assert [row for row in rows if row.kind is Kind.MESSAGE] == [
        Row(Kind.MESSAGE, 7, 9, each) for each in data
    ]
    assert len(rows) == 6
