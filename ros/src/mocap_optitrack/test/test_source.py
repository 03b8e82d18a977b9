"""The thread that keeps a connection alive."""

import queue
import threading
import time

import pytest

from mocap_optitrack import source as module
from mocap_optitrack.frames import Frame
from mocap_optitrack.source import Receiver, Source, SourceError

LIMIT = 60.0


class ScriptedSource(Source):
    """A system that does what a list says: raise, return, or be silent for some seconds."""

    silence_hint = "is it plugged in?"

    def __init__(self, script):
        self._script = script
        self.is_closed = False

    def open(self):
        return self._next("nothing")

    def read(self, limit):
        if not self._script:
            time.sleep(limit)
            return None
        return self._next(None)

    def close(self):
        self.is_closed = True

    def _next(self, default):
        value = self._script.pop(0) if self._script else default
        if isinstance(value, Exception):
            raise value
        if isinstance(value, float):
            time.sleep(value)
            return None
        return value


class Run:
    """A receiver of scripted sources, and what it says."""

    def __init__(self, *scripts):
        self.said = queue.Queue()
        self.sources = [ScriptedSource(list(script)) for script in scripts]
        self._left = list(self.sources)
        self.receiver = Receiver(
            self._make,
            lambda text: self.said.put(("connected", text)),
            lambda frame: self.said.put(("frame", frame)),
            lambda text: self.said.put(("silence", text)),
            lambda text: self.said.put(("failure", text)),
        )

    def __enter__(self):
        self.receiver.start()
        return self

    def __exit__(self, *exception):
        self.receiver.stop()

    def next(self):
        """Return the next thing it says."""
        return self.said.get(timeout=LIMIT)

    def _make(self):
        return self._left.pop(0) if self._left else ScriptedSource([])


@pytest.fixture(autouse=True)
def _short_waits(monkeypatch):
    monkeypatch.setattr(module, "_RETRY", 0.001)
    monkeypatch.setattr(module, "_POLL", 0.001)
    monkeypatch.setattr(module, "_SILENCE", 0.05)
    monkeypatch.setattr(module, "_RECONNECT_AFTER", 0.5)


def frame(number):
    """Return one of many frames."""
    return Frame(None, None, float(number), ())


def test_frames_are_handed_over_in_order():
    with Run(["a server", frame(1), None, frame(2)]) as run:
        said = [run.next() for _ in range(3)]
    assert said == [("connected", "a server"), ("frame", frame(1)), ("frame", frame(2))]
    assert run.sources[0].is_closed


def test_a_connection_that_cannot_be_opened_is_tried_again():
    with Run([SourceError("no answer")], [SourceError("no answer")], ["a server"]) as run:
        said = [run.next() for _ in range(3)]
    assert said == [("failure", "no answer"), ("failure", "no answer"), ("connected", "a server")]
    assert all(source.is_closed for source in run.sources)


def test_a_connection_that_ends_is_made_again():
    with Run(["a server", frame(1), SourceError("gone")], ["a server", frame(2)]) as run:
        said = [run.next() for _ in range(5)]
    assert said[2:] == [("failure", "gone"), ("connected", "a server"), ("frame", frame(2))]


def test_a_connection_that_is_silent_for_a_while_is_kept():
    silence = [0.02] * 5
    with Run(["a server", frame(1), *silence, frame(2), *silence, frame(3)]) as run:
        said = [run.next() for _ in range(6)]
        assert not run.sources[0].is_closed
    text = "no frames for 0.05 s; is it plugged in?"
    assert said[2:5] == [("silence", text), ("frame", frame(2)), ("silence", text)]


def test_a_connection_without_frames_is_given_up():
    with Run(["a server", frame(1)], ["a server", frame(2)]) as run:
        said = [run.next() for _ in range(6)]
    assert said[2] == ("silence", "no frames for 0.05 s; is it plugged in?")
    assert said[3] == ("failure", "no frames for 0.5 s; is it plugged in?")
    assert said[5] == ("frame", frame(2))


def test_the_thread_outlives_errors_nobody_thought_of():
    with Run([ZeroDivisionError()], ["a server", KeyError(7)], ["another"]) as run:
        said = [run.next() for _ in range(4)]
    assert "ZeroDivisionError" in said[0][1]
    assert "KeyError: 7" in said[2][1]
    assert said[3] == ("connected", "another")


def test_stops_while_it_waits():
    run = Run()
    before = threading.active_count()
    with run:
        assert run.next() == ("connected", "nothing")
    assert threading.active_count() == before
