"""Parameters are set without waiting for the master."""

import threading

import pytest

from crazyflie_utils.parameters.server import ParameterWriter
from crazyflie_utils.testing.programs import wait_until


class Master:
    """A parameter server that answers when it is told to."""

    def __init__(self):
        self.written = []
        self.may_answer = threading.Event()
        self.is_asked = threading.Event()
        self.error = None

    def write(self, name, value):
        """Set a parameter."""
        self.is_asked.set()
        assert self.may_answer.wait(20.0)
        if self.error is not None:
            raise self.error
        self.written.append((name, value))


@pytest.fixture
def master():
    """Return a master that is frozen."""
    return Master()


def test_no_node_waits_for_a_frozen_master(master):
    writer = ParameterWriter(master.write, print)
    writer.set("/a", 0)
    assert master.is_asked.wait(20.0)
    for value in range(1, 1000):
        replaced = writer.set("/a", value)
        writer.set("/b", -value)
    assert master.written == []
    master.may_answer.set()
    wait_until(lambda: len(master.written) == 3, "the latest values")
    assert master.written == [("/a", 0), ("/a", 999), ("/b", -999)]
    assert replaced.done()


def test_later_changes_are_set_too(master):
    master.may_answer.set()
    writer = ParameterWriter(master.write, print)
    for value in range(3):
        writer.set("/a", value).result(20.0)
        assert master.written[-1] == ("/a", value)


def test_what_cannot_be_set_is_reported_and_ends_nothing(master):
    reports = []
    master.may_answer.set()
    master.error = OSError("no master")
    writer = ParameterWriter(master.write, reports.append)
    done = writer.set("/a", 1)
    assert done.exception(20.0) is master.error
    assert "/a" in reports[0]
    assert "no master" in reports[0]
    master.error = None
    writer.set("/b", 2)
    wait_until(lambda: master.written == [("/b", 2)], "the next value")
