"""swarm.input: a joystick, the terminal's keys, or nobody."""

import os
import pty
import signal
import struct
import sys
import threading
import time
from pathlib import Path

import pytest
from sim import simulated

from crazyflie_py.buttons import UNATTENDED_DELAY, Input


def button(number, value):
    """Return what Linux reports when a button changes."""
    return struct.pack("=IhBB", 0, value, 0x01, number)


class Stick:
    """A joystick whose device is a pipe."""

    def __init__(self, path):
        os.mkfifo(path)
        self._file = os.open(path, os.O_RDWR)

    def change(self, number, value):
        os.write(self._file, button(number, value))

    def pull_out(self):
        os.close(self._file)


@pytest.fixture
def stick(tmp_path):
    return Stick(tmp_path / "js0")


@pytest.fixture
def swarm():
    return simulated("--dt 0.01")


def read_from(swarm, tmp_path):
    return Input(swarm.timeHelper, True, str(tmp_path / "js*"))


@pytest.fixture
def no_terminal(monkeypatch):
    with open(os.devnull) as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        yield


def test_the_button_is_number_5(swarm, stick, tmp_path):
    buttons = read_from(swarm, tmp_path)
    assert not buttons.checkIfButtonIsPressed()
    stick.change(3, 1)
    assert not buttons.checkIfButtonIsPressed()
    assert buttons.checkIfAnyButtonIsPressed() == [0, 0, 0, 1]
    stick.change(5, 1)
    assert buttons.checkIfButtonIsPressed()
    stick.change(5, 0)
    stick.change(3, 0)
    assert not buttons.checkIfButtonIsPressed()
    assert buttons.checkIfAnyButtonIsPressed() is None


def test_a_wait_ends_when_the_button_is_released(swarm, stick, tmp_path):
    buttons = read_from(swarm, tmp_path)
    stick.change(5, 1)
    threading.Timer(0.05, stick.change, (5, 0)).start()
    buttons.waitUntilButtonPressed()
    assert not buttons.checkIfButtonIsPressed()
    assert swarm.timeHelper.time() > 0.0


def test_a_wait_for_any_button_returns_all(swarm, stick, tmp_path):
    buttons = read_from(swarm, tmp_path)
    stick.change(4, 1)
    threading.Timer(0.05, stick.change, (4, 0)).start()
    assert buttons.waitUntilAnyButtonPressed() == [0, 0, 0, 0, 1]


def test_a_joystick_that_is_pulled_out_is_an_error(swarm, stick, tmp_path):
    buttons = read_from(swarm, tmp_path)
    assert not buttons.checkIfButtonIsPressed()
    stick.pull_out()
    with pytest.raises(RuntimeError, match="the joystick .*js0 was disconnected"):
        buttons.waitUntilButtonPressed()


def test_without_anybody_the_simulation_presses_the_button(swarm, no_terminal, tmp_path, caplog):
    buttons = read_from(swarm, tmp_path)
    buttons.waitUntilButtonPressed()
    assert UNATTENDED_DELAY == pytest.approx(swarm.timeHelper.time(), abs=0.05)
    assert "neither a joystick nor a terminal" in caplog.text
    while not buttons.checkIfButtonIsPressed():
        swarm.timeHelper.sleep(0.1)
    assert 2 * UNATTENDED_DELAY == pytest.approx(swarm.timeHelper.time(), abs=0.3)


def test_without_anybody_a_wait_for_real_vehicles_is_an_error(swarm, no_terminal, tmp_path):
    buttons = Input(swarm.timeHelper, False, str(tmp_path / "js*"))
    with pytest.raises(RuntimeError, match="neither a joystick .* nor a terminal"):
        buttons.waitUntilButtonPressed()


def test_a_joystick_that_cannot_be_opened_is_reported(swarm, no_terminal, tmp_path, caplog):
    (tmp_path / "js0").symlink_to(tmp_path / "nothing")
    (tmp_path / "js1").symlink_to("js1")
    assert not read_from(swarm, tmp_path).checkIfButtonIsPressed()
    assert "js1: Too many levels of symbolic links" in caplog.text


def test_any_key_is_the_button(tmp_path):
    # In a process of its own, whose terminal is a pseudo-terminal.
    pid, terminal = pty.fork()
    if pid == 0:
        script = f"""from sim import simulated
from crazyflie_py.buttons import Input
buttons = Input(simulated().timeHelper, True, "{tmp_path}/js*")
print("ready", flush=True)
buttons.waitUntilButtonPressed()
raise SystemExit(7)"""
        os.chdir(Path(__file__).parent)
        os.execv(sys.executable, [sys.executable, "-c", script])
    try:
        output = b""
        while b"ready" not in output:
            output += os.read(terminal, 1024)
        os.write(terminal, b"x")
        deadline = time.monotonic() + 20.0
        while (ended := os.waitpid(pid, os.WNOHANG))[0] == 0 and time.monotonic() < deadline:
            time.sleep(0.01)
        if ended[0] == 0:
            os.kill(pid, signal.SIGKILL)
            ended = os.waitpid(pid, 0)
    finally:
        os.close(terminal)
    assert os.waitstatus_to_exitcode(ended[1]) == 7
