"""Work that waits for something outside: in turn with callbacks, and in the journal."""

import threading
from types import SimpleNamespace

import pytest
from std_msgs.msg import Float64, String

from crazyflie_utils import Node
from crazyflie_utils.external import External, Interface
from crazyflie_utils.journal.journal_file import Journal, JournalWriter
from crazyflie_utils.journal.recording import Recorder
from crazyflie_utils.journal.replay import Replay
from crazyflie_utils.journal.replay_transport import DifferenceError
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.testing.programs import wait_until

LIMIT = 60.0
HEADER = {"node": "/asker", "program": "", "clock": "manual", "start": 100.0, "us": 0}


class WeatherError(Exception):
    """An error of its own."""


class Weather:
    """Something outside, which answers when a test lets it."""

    place = "Delft"

    def __init__(self):
        self.answers = threading.Semaphore(0)
        self.asked = []
        self.wind = SimpleNamespace(speed=lambda height: 2.0 * height)

    def forecast(self, hours):
        self.asked.append(hours)
        assert self.answers.acquire(timeout=LIMIT)
        if hours > 24:
            raise WeatherError("too far ahead")
        return [1.5 * hours, 0.1]


INTERFACE = Interface(
    parts=frozenset(["wind"]),
    reads=frozenset(["place"]),
    waits=frozenset(["forecast"]),
    errors={"WeatherError": WeatherError},
)


class AskingNode(Node):
    """Asks for each number that comes; says what came meanwhile."""

    factor = 1.0

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self.weather = External(handle, INTERFACE, None if handle.is_replay else Weather(), "it")
        self.out = handle.publisher("/out", String)
        self.count = 0
        handle.subscribe("/in", Float64, self.on_in)

    def on_in(self, message):
        self.count += 1
        self._handle.task("ask", lambda: self.ask(self.factor * message.data))

    def ask(self, hours):
        before = self.count
        try:
            answer = self.weather.forecast(hours)
        except WeatherError as error:
            answer = str(error)
        wind = self.weather.wind.speed(before)
        text = f"{self.weather.place} {hours}: {answer}, {wind}, {self.count - before} came"
        self.out.publish(String(text))


@pytest.fixture
def asked(tmp_path):
    """Return what a node has published that three tasks of it asked for, and its journal."""
    path = tmp_path / "asker.journal"
    recorder = Recorder(JournalWriter(path, HEADER, 1e9, print))
    process, node = FakeProcess(recorder=recorder), AskingNode()
    assert process.launch(node, "/asker")
    weather = node.weather.target
    for k, hours in enumerate((1.0, 48.0, 2.0)):
        process.publish("/in", Float64(hours))
        wait_until(lambda k=k: len(weather.asked) > k, "the question")
    for k in range(3):
        weather.answers.release()
        wait_until(lambda k=k: len(process.published("/out")) > k, "the answer")
    recorder.close()
    return sorted(each.data for each in process.published("/out")), path


def run_again(path):
    with Replay(Journal(path)) as replay:
        published = []
        replay.transport.on_publish = lambda _, message: published.append(message.data)
        assert replay.start()
        while replay.step():
            pass
    return sorted(published)


def test_others_have_their_turn_while_a_task_waits(asked):
    published, _ = asked
    assert published == [
        "Delft 1.0: [1.5, 0.1], 2.0, 2 came",
        "Delft 2.0: [3.0, 0.1], 6.0, 0 came",
        "Delft 48.0: too far ahead, 4.0, 1 came",
    ]


def test_tasks_run_again_without_what_is_outside(asked):
    published, path = asked
    threads = threading.active_count()
    assert run_again(path) == published
    wait_until(lambda: threading.active_count() <= threads, "the ends of threads")


def test_what_is_asked_for_is_compared(asked, monkeypatch):
    _, path = asked
    monkeypatch.setattr(AskingNode, "factor", 3.0)
    with pytest.raises(DifferenceError, match=r"it forecast\(3.0\).*it forecast\(1.0\)"):
        run_again(path)


def test_a_task_whose_work_fails_is_reported(asked):
    process, node = FakeProcess(), AskingNode()
    assert process.launch(node, "/asker")
    process.handle("/asker").task("fails", lambda: 1 / 0)
    wait_until(lambda: process.logged("error"), "the report")
    assert "ZeroDivisionError" in process.logged("error")[0]
    process.publish("/in", Float64(1.0))
    wait_until(lambda: node.weather.target.asked, "the next task")
    node.weather.target.answers.release()
