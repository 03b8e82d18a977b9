"""Which thread lands the vehicles of a script, and which ones may command them."""

import threading

import pytest

from crazyflie_mission_api import MissionError
from crazyflie_mission_api.script_end import ScriptEnd

LIMIT = 10.0  #: Of a wait for another thread, s.


class Landing:
    """A landing in a thread of its own, which lasts until it is told to end."""

    def __init__(self, end):
        self.has_begun, self.may_end, self.calls = threading.Event(), threading.Event(), 0
        self._end = end
        self._thread = threading.Thread(target=end.run, args=(self._land,), daemon=True)

    def _land(self):
        self.calls += 1
        with self._end.commanding():
            self.has_begun.set()
        assert self.may_end.wait(LIMIT)

    def __enter__(self):
        self._thread.start()
        assert self.has_begun.wait(LIMIT)
        return self

    def __exit__(self, *_):
        self.may_end.set()
        self._thread.join(LIMIT)
        assert not self._thread.is_alive()


def refused(end):
    """Return whether this thread may not command."""
    try:
        with end.commanding():
            return False
    except MissionError:
        return True


def test_while_one_thread_lands_and_afterwards_no_other_one_commands():
    end = ScriptEnd(lambda: False)
    assert not refused(end)
    with Landing(end):
        assert refused(end)
    assert refused(end)


def test_who_comes_second_waits_until_the_vehicles_have_landed():
    end = ScriptEnd(lambda: False)
    with Landing(end) as landing:
        second = threading.Thread(target=end.run, args=(pytest.fail,), daemon=True)
        second.start()
        second.join(0.05)
        assert second.is_alive()
    second.join(LIMIT)
    assert not second.is_alive()
    assert landing.calls == 1


def test_when_ros_shuts_down_only_the_landing_commands():
    end = ScriptEnd(lambda: True)
    assert refused(end)
    allowed = []
    end.run(lambda: allowed.append(not refused(end)))
    assert allowed == [True]


def test_a_shutdown_within_the_landing_does_not_begin_another_one():
    end, calls = ScriptEnd(lambda: False), []

    def land():
        calls.append("land")
        # In the same thread: the end of the landing shuts the node down.
        end.run(land)

    end.run(land)
    assert calls == ["land"]


def test_a_landing_that_fails_is_not_repeated():
    end = ScriptEnd(lambda: False)
    with pytest.raises(ZeroDivisionError):
        end.run(lambda: 1 / 0)
    end.run(pytest.fail)
    assert refused(end)
