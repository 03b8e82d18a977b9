"""The meaning of a joystick's bytes."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_demo.joystick import EVENT, Joystick


def axis(number, value, initial=False):
    return struct.pack("=IhBB", 0, value, 0x82 if initial else 0x02, number)


def button(number, value, initial=False):
    return struct.pack("=IhBB", 0, value, 0x81 if initial else 0x01, number)


def test_an_event_has_eight_bytes():
    assert EVENT.size == 8


def test_how_it_was_found_is_one_state():
    joystick = Joystick()
    data = axis(0, 0, True) + axis(1, 16384, True) + button(0, 0, True) + button(1, 1, True)
    (state,) = joystick.feed(data)
    assert state == ([0.0, pytest.approx(-0.5, abs=1e-4)], [0, 1])


def test_left_and_up_are_positive_and_reach_one():
    joystick = Joystick()
    for value, expected in ((-32767, 1.0), (-32768, 1.0), (32767, -1.0), (0, 0.0)):
        assert joystick.feed(axis(2, value)) == [([0.0, 0.0, expected], [])]


@pytest.mark.parametrize("deadzone", [0.0, 0.05, 0.5])
def test_the_deadzone_is_cut_out_without_a_step(deadzone):
    joystick = Joystick()

    def deflect(part):
        return joystick.feed(axis(0, round(-32767 * part)), deadzone)[0][0][0]

    assert deflect(deadzone * 0.99) == 0.0
    assert deflect(-deadzone * 0.99) == 0.0
    assert deflect(deadzone + 0.001) == pytest.approx(0.001 / (1.0 - deadzone), abs=1e-4)
    assert deflect(-deadzone - 0.001) == pytest.approx(-0.001 / (1.0 - deadzone), abs=1e-4)
    assert deflect(1.0) == 1.0
    assert deflect(-1.0) == -1.0


def test_no_press_is_lost_that_was_short():
    joystick = Joystick()
    states = joystick.feed(button(2, 1) + button(2, 0) + axis(0, 32767))
    assert states == [([], [0, 0, 1]), ([], [0, 0, 0]), ([-1.0], [0, 0, 0])]


def test_other_events_are_ignored():
    assert Joystick().feed(struct.pack("=IhBB", 0, 1, 0x04, 0)) == []


def test_release_is_zero():
    joystick = Joystick()
    joystick.feed(axis(1, 32767) + button(1, 1) + b"\0\0\0")
    assert joystick.release() == ([0.0, 0.0], [0, 0])
    # The earlier part of an event is dropped.
    assert joystick.feed(axis(0, -32767)) == [([1.0, 0.0], [0, 0])]


events = st.one_of(
    st.builds(axis, st.integers(0, 7), st.integers(-32768, 32767), st.booleans()),
    st.builds(button, st.integers(0, 10), st.integers(0, 1), st.booleans()),
)


@given(st.lists(events, min_size=1, max_size=20), st.lists(st.integers(0, 160), max_size=5))
def test_it_does_not_matter_where_the_stream_is_cut(parts, cuts):
    data = b"".join(parts)
    whole, pieces = Joystick(), Joystick()
    whole.feed(data, 0.1)
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    for begin, end in zip(edges, edges[1:], strict=False):
        pieces.feed(data[begin:end], 0.1)
    assert pieces.state() == whole.state()
    assert all(-1.0 <= value <= 1.0 for value in whole.axes)
