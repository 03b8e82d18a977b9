"""What is shown of waits, and of programs that are launched."""

import io
import sys
import threading

import pytest

from crazyflie_utils import terminal

OUTPUT = """... logging to /home/ada/.ros/log
 * /cf1/state_estimator/time_step: 0.01
\x1b[0m[INFO] [1795984322.0]: /cf1: taking off\x1b[0m
\x1b[33m[WARN] [1795984322.012]: /cf1: too far\x1b[0m
\x1b[31m[ERROR] [1795984322.0, 12.5]: /cf2: no pose\x1b[0m
Traceback (most recent call last):
  File "a.py", line 1, in <module>
ValueError: 3
[cf1-2] process has died [pid 3, exit code 1]
finished
"""


class Screen(io.StringIO):
    """Stands in for stderr."""

    def __init__(self, is_terminal):
        super().__init__()
        self.isatty = lambda: is_terminal
        self.has_line = threading.Event()

    def write(self, text):
        if text.strip():
            self.has_line.set()
        return super().write(text)


@pytest.fixture(params=[True, False])
def screen(request):
    return Screen(request.param)


def test_warnings_are_shown_and_all_is_in_the_log(screen, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "stderr", screen)
    lines = []
    terminal.copy_output(io.StringIO(OUTPUT), tmp_path / "log", lines.append)
    assert screen.getvalue().replace(terminal._CLEAR, "").splitlines() == [
        "[WARN] /cf1: too far",
        "[ERROR] /cf2: no pose",
        "Traceback (most recent call last):",
        '  File "a.py", line 1, in <module>',
        "ValueError: 3",
        "[cf1-2] process has died [pid 3, exit code 1]",
    ]
    assert (tmp_path / "log").read_text().splitlines() == lines
    assert len(lines) == OUTPUT.count("\n")


def test_a_long_wait_is_shown_until_its_end(screen, monkeypatch):
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(terminal, "_SHOWN_AFTER", 0.0)
    with terminal.waiting("for a pose"):
        assert not screen.isatty() or screen.has_line.wait(60.0)
        terminal.say("a warning")
    shown = screen.getvalue()
    if not screen.isatty():
        assert shown == "a warning\n"
        return
    assert "for a pose: 0 s" in shown
    assert f"{terminal._CLEAR}a warning\n" in shown
    assert shown.endswith(terminal._CLEAR)


def test_a_short_wait_is_not_shown(screen, monkeypatch):
    monkeypatch.setattr(sys, "stderr", screen)
    with terminal.waiting("for a pose"):
        pass
    assert screen.getvalue() == ""
