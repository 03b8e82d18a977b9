"""Keys in the place of a joystick."""

import pytest

from crazyflie_demo.joystick import (
    AXES,
    EMERGENCY,
    HEADLIGHT,
    LAND,
    PITCH,
    ROLL,
    TAKEOFF,
    THRUST,
    YAW,
)
from crazyflie_demo.keyboard import FIRST_HOLD, REPEAT_HOLD, Keyboard

REST = [0.0] * AXES


def deflected(**values):
    numbers = {"roll": ROLL, "pitch": PITCH, "yaw": YAW, "thrust": THRUST}
    axes = list(REST)
    for name, value in values.items():
        axes[numbers[name]] = value
    return axes


@pytest.mark.parametrize(
    ("keys", "axes"),
    [
        ("\x1b[A", {"pitch": 0.5}),
        ("\x1bOB", {"pitch": -0.5}),
        ("\x1b[D", {"roll": 0.5}),
        ("\x1b[C", {"roll": -0.5}),
        ("w", {"thrust": 0.5}),
        ("S", {"thrust": -0.5}),
        ("a", {"yaw": 0.5}),
        ("d", {"yaw": -0.5}),
        ("w\x1b[Aa", {"pitch": 0.5, "thrust": 0.5, "yaw": 0.5}),
        ("ad", {"yaw": -0.5}),
        ("q?1\x7f", {}),
    ],
)
def test_keys_move_axes(keys, axes):
    keyboard = Keyboard()
    assert keyboard.feed(keys, 10.0, 0.5) == []
    assert keyboard.axes(10.0) == deflected(**axes)


def test_keys_press_buttons():
    assert Keyboard().feed("tlH ", 0.0) == [TAKEOFF, LAND, HEADLIGHT, EMERGENCY]


def test_an_arrow_may_come_in_pieces():
    keyboard = Keyboard()
    for part in ("\x1b", "[", "A"):
        assert keyboard.axes(0.0) == REST
        keyboard.feed(part, 0.0)
    assert keyboard.axes(0.0) == deflected(pitch=1.0)


def test_escape_alone_eats_no_key():
    assert Keyboard().feed("\x1b", 0.0) == []
    keyboard = Keyboard()
    keyboard.feed("\x1b", 0.0)
    assert keyboard.feed("t", 1.0) == [TAKEOFF]


def test_a_key_is_let_go_when_it_is_not_repeated():
    keyboard = Keyboard()
    keyboard.feed("w", 0.0)
    assert keyboard.axes(FIRST_HOLD - 0.01) == deflected(thrust=1.0)
    assert keyboard.axes(FIRST_HOLD + 0.01) == REST


def test_a_key_that_is_held_is_let_go_soon_after():
    keyboard = Keyboard()
    time = 0.0
    keyboard.feed("w", time)
    for time in (0.5, 0.53, 0.56, 0.6, 0.7, 0.8):
        keyboard.feed("w", time)
        assert keyboard.axes(time) == deflected(thrust=1.0)
    assert keyboard.axes(time + REPEAT_HOLD - 0.01) == deflected(thrust=1.0)
    assert keyboard.axes(time + REPEAT_HOLD + 0.01) == REST


@pytest.mark.parametrize("key", ["x", " "])
def test_everything_can_be_let_go(key):
    keyboard = Keyboard(lift_step=0.1)
    keyboard.feed("wwa", 0.0)
    keyboard.feed(key, 0.1)
    assert keyboard.axes(0.1) == REST


def test_thrust_can_go_in_steps_and_stay():
    keyboard = Keyboard(lift_step=0.3)
    levels = []
    for key in "wwwwsss s":
        keyboard.feed(key, 0.0)
        levels.append(keyboard.axes(100.0)[THRUST])
    assert levels == pytest.approx([0.3, 0.6, 0.9, 1.0, 0.7, 0.4, 0.1, 0.0, 0.0])
