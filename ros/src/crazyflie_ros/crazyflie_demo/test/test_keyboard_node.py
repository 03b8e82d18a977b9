"""The keyboard node on a terminal of its own."""

import os
import pty
import termios

import pytest

from crazyflie_demo.joystick import LAND, PITCH, TAKEOFF
from crazyflie_demo.keyboard_node import KeyboardNode
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess


class Terminal:
    def __init__(self):
        self.keys, self.end = pty.openpty()
        self.stdin = os.fdopen(self.end, "r")

    def type(self, text):
        os.write(self.keys, text.encode())

    def mode(self):
        return termios.tcgetattr(self.end)


@pytest.fixture
def terminal(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr("sys.stdin", terminal.stdin)
    yield terminal
    terminal.stdin.close()
    if terminal.keys is not None:
        os.close(terminal.keys)


def launch(**parameters):
    process = FakeProcess()
    node = KeyboardNode()
    assert process.launch(node, "/crazyflie/keyboard", parameters)
    process.node = node
    return process


def messages(process):
    return process.published("/crazyflie/joy")


def test_keys_become_messages(terminal):
    process = launch(deflection=0.8)
    terminal.type("tl\x1b[A")
    process.advance(0.5)
    assert len(messages(process)) == 10
    presses = [[i for i, pressed in enumerate(m.buttons) if pressed] for m in messages(process)]
    # One press a message, and none twice.
    assert presses == [[TAKEOFF], [LAND]] + [[]] * 8
    assert [m.axes[PITCH] for m in messages(process)] == [0.8] * 10
    process.advance(0.5)
    assert messages(process)[-1].axes == [0.0] * 8
    process.node.shutdown()


def test_the_terminal_is_given_back_as_it_was(terminal):
    before = terminal.mode()
    process = launch()
    echo, line = termios.ECHO, termios.ICANON
    assert not terminal.mode()[3] & (echo | line)
    # Ctrl-C still ends the process.
    assert terminal.mode()[3] & termios.ISIG
    process.node.shutdown()
    assert terminal.mode() == before
    assert before[3] & echo
    assert before[3] & line


@pytest.mark.parametrize("parameters", [{"deflection": 0.0}, {"lift_step": 2.0}])
def test_a_bad_parameter_leaves_the_terminal_alone(terminal, parameters):
    before = terminal.mode()
    process = FakeProcess()
    assert not process.launch(KeyboardNode(), "/keyboard", parameters)
    assert next(iter(parameters)) in process.logged("error")[0]
    assert terminal.mode() == before


def test_needs_a_terminal(monkeypatch):
    with open(os.devnull) as nothing:
        monkeypatch.setattr("sys.stdin", nothing)
        process = FakeProcess()
        assert not process.launch(KeyboardNode(), "/keyboard")
    assert "not a terminal" in process.logged("error")[0]


def test_the_deflection_may_be_changed(terminal):
    process = launch()
    process.reconfigure("/crazyflie/keyboard", deflection=0.2)
    with pytest.raises(ServiceError, match="/crazyflie/keyboard/deflection is 2.0; expected"):
        process.reconfigure("/crazyflie/keyboard", deflection=2.0)
    terminal.type("\x1b[A")
    process.advance(0.1)
    assert messages(process)[-1].axes[PITCH] == 0.2
    process.node.shutdown()
