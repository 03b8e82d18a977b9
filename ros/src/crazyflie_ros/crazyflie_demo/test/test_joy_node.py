"""The joystick node reads a FIFO or a terminal in the place of a joystick."""

import errno
import os

import pytest
from sensor_msgs.msg import Joy
from test_joystick import axis, button

from crazyflie_demo.joy_node import JoyNode
from crazyflie_demo.node_parts import REPEATED
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess


@pytest.fixture
def fifo(tmp_path):
    path = tmp_path / "js0"
    os.mkfifo(path)
    return path


def launch(dev, **changes):
    process = FakeProcess()
    node = JoyNode()
    assert process.launch(node, "/crazyflie/joy", {"dev": str(dev), **changes})
    process.node = node
    return process


def states(process):
    """Return what was published: a list of (axes, buttons)."""
    return [(list(m.axes), list(m.buttons)) for m in process.published("/crazyflie/joy")]


def test_replays_a_stream_of_events(fifo):
    process = launch(fifo, autorepeat_rate=0.0, deadzone=0.0)
    with open(fifo, "wb", buffering=0) as stick:
        stick.write(axis(0, 0, True) + axis(1, 0, True) + button(0, 0, True))
        process.advance(0.05)
        stick.write(axis(1, -32767))
        process.advance(0.05)
        stick.write(button(0, 1) + button(0, 0))
        process.advance(0.05)
        process.advance(1.0)
    assert states(process) == [
        ([0.0, 0.0], [0]),
        ([0.0, 1.0], [0]),
        ([0.0, 1.0], [1]),
        ([0.0, 1.0], [0]),
    ]
    message = process.published("/crazyflie/joy")[0]
    assert isinstance(message, Joy)
    assert message.header.stamp.to_sec() == pytest.approx(100.0, abs=0.02)
    assert message.header.frame_id == ""
    process.node.shutdown()


def test_repeats_itself(fifo):
    process = launch(fifo, autorepeat_rate=10.0)
    process.advance(1.0)
    assert states(process) == []
    with open(fifo, "wb", buffering=0) as stick:
        stick.write(axis(0, -32767))
        process.advance(1.0)
        assert len(states(process)) == pytest.approx(11, abs=1)
        assert set(map(str, states(process))) == {"([1.0], [])"}
    assert process.published("/crazyflie/joy")[0].header.frame_id == REPEATED
    process.node.shutdown()


def test_waits_for_the_joystick_and_says_so(tmp_path):
    process = launch(tmp_path / "js0")
    process.advance(2.5)
    (warning,) = process.logged("warn")
    assert "js0: No such file or directory; is it plugged in" in warning
    os.mkfifo(tmp_path / "js0")
    process.advance(1.1)
    assert "reading" in process.logged("info")[0]
    process.node.shutdown()


@pytest.mark.parametrize("kind", ["/dev/zero", "/dev/null", "/dev/urandom", "file", "folder"])
def test_something_else_is_not_read_as_a_joystick(tmp_path, kind):
    path = tmp_path / "js0"
    if kind == "file":
        path.write_bytes(axis(0, 32767))
    elif kind == "folder":
        path.mkdir()
    else:
        path = kind
    process = launch(path)
    process.advance(0.5)
    (warning,) = process.logged("warn")
    assert warning.startswith(f"/crazyflie/joy: cannot open {path}: it is not a joystick")
    assert process.logged("info") == process.logged("error") == states(process) == []
    process.node.shutdown()


def test_the_home_folder_is_found_and_the_path_is_absolute(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    for dev in ("~/js7", "js7"):
        process = launch(dev)
        assert f"cannot open {tmp_path}/js7: No such file" in process.logged("warn")[0]
        process.node.shutdown()


def test_an_unplugged_joystick_is_released_and_taken_up_again(fifo, monkeypatch):
    process = launch(fifo)
    with open(fifo, "wb", buffering=0) as stick:
        stick.write(axis(1, -32767) + button(3, 1))
        process.advance(0.2)
        assert states(process)[-1] == ([0.0, 1.0], [0, 0, 0, 1])
        with monkeypatch.context() as unplugged:
            # Errors of the kernel for an unplugged joystick, and then for its file.
            unplugged.setattr("os.read", refuse(errno.ENODEV))
            process.advance(0.05)
            unplugged.setattr("os.open", refuse(errno.ENOENT))
            assert states(process)[-1] == ([0.0, 0.0], [0, 0, 0, 0])
            assert "lost" in process.logged("error")[0]
            # The node is silent without a joystick.
            count = len(states(process))
            process.advance(3.0)
            assert len(states(process)) == count
        process.advance(1.1)
    with open(fifo, "wb", buffering=0) as stick:
        stick.write(axis(0, 32767))
        process.advance(0.05)
    assert states(process)[-1] == ([-1.0, 0.0], [0, 0, 0, 0])
    process.node.shutdown()


def refuse(code):
    """Return a system call that fails."""

    def call(*_):
        raise OSError(code, os.strerror(code))

    return call


@pytest.mark.parametrize(
    "changes", [{"dev": ""}, {"deadzone": 1.0}, {"deadzone": -0.1}, {"autorepeat_rate": -1.0}]
)
def test_a_bad_parameter_is_named(changes):
    process = FakeProcess()
    assert not process.launch(JoyNode(), "/joy", changes)
    assert f"/joy/{next(iter(changes))}" in process.logged("error")[0]


def test_the_dead_zone_may_be_changed(fifo):
    process = launch(fifo)
    process.reconfigure("/crazyflie/joy", deadzone=0.5)
    with pytest.raises(ServiceError, match="/crazyflie/joy/deadzone is 1.0; expected"):
        process.reconfigure("/crazyflie/joy", deadzone=1.0)
    with open(fifo, "wb", buffering=0) as stick:
        stick.write(axis(0, -15000))
        process.advance(0.05)
    assert states(process)[-1] == ([0.0], [])
    process.node.shutdown()
