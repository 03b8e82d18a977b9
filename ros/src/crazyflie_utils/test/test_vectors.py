"""Messages to vectors and back, for every message of the workspace."""

import inspect
import math

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from hypothesis import given
from hypothesis import strategies as st
from std_msgs.msg import Float32MultiArray, Header, String
from tf2_msgs.msg import TFMessage

import crazyflie_msgs.msg
from crazyflie_msgs.msg import Control, ControlStamped, FullState, PrioritizedControl
from crazyflie_utils.vectors import from_vector, is_finite, to_vector

MESSAGES = [message for _, message in inspect.getmembers(crazyflie_msgs.msg, inspect.isclass)]
FLAT = [message for message in MESSAGES if set(message._slot_types) == {"float64"}]
NESTED = [message for message in MESSAGES if message not in FLAT]
BAD = [math.nan, math.inf, -math.inf]


def holders_of_numbers(message):
    """Yield (message, field) of every float64 below a message."""
    for field, kind in zip(message.__slots__, message._slot_types, strict=True):
        if kind == "float64":
            yield message, field
        elif kind.startswith("crazyflie_msgs/"):
            yield from holders_of_numbers(getattr(message, field))


def test_flat_messages_are_those_of_numbers_only():
    assert Control in FLAT
    assert ControlStamped in NESTED


@pytest.mark.parametrize("message_type", FLAT)
@given(data=st.data())
def test_vectors_come_back(message_type, data):
    size = len(message_type.__slots__)
    vector = data.draw(st.lists(st.floats(allow_nan=False), min_size=size, max_size=size))
    message = from_vector(message_type, np.array(vector))
    assert isinstance(message, message_type)
    assert [getattr(message, field) for field in message.__slots__] == vector
    np.testing.assert_array_equal(to_vector(message), vector)


@pytest.mark.parametrize("message_type", FLAT)
@pytest.mark.parametrize("surplus", [-1, 1])
def test_wrong_length_is_named(message_type, surplus):
    size = len(message_type.__slots__)
    with pytest.raises(
        ValueError, match=f"{message_type._type} has {size} fields .* {size + surplus}"
    ):
        from_vector(message_type, np.zeros(size + surplus))


def test_entries_are_plain_floats_in_the_order_of_the_definition():
    control = from_vector(Control, np.array([1, 2, 3, 4]))
    assert (control.roll, control.pitch, control.yaw_dot, control.thrust) == (1.0, 2.0, 3.0, 4.0)
    assert all(type(getattr(control, field)) is float for field in control.__slots__)
    state = from_vector(FullState, range(12))
    assert (state.z_dot, state.roll, state.yaw_dot) == (5.0, 6.0, 11.0)


@pytest.mark.parametrize("message_type", NESTED)
def test_what_is_not_flat_is_no_vector(message_type):
    with pytest.raises((TypeError, ValueError)):
        to_vector(message_type())


@pytest.mark.parametrize("message_type", MESSAGES)
@pytest.mark.parametrize("bad", BAD)
def test_every_number_must_be_finite(message_type, bad):
    assert is_finite(message_type())
    for index in range(len(list(holders_of_numbers(message_type())))):
        message = message_type()
        holder, field = list(holders_of_numbers(message))[index]
        setattr(holder, field, bad)
        assert not is_finite(message), f"{field} is {bad}"


def test_numbers_of_prioritized_control():
    assert len(list(holders_of_numbers(PrioritizedControl()))) == 5


@pytest.mark.parametrize("bad", [*BAD, np.float64("nan"), np.float32("inf")])
def test_numbers_of_any_make_must_be_finite(bad):
    assert not is_finite(ControlStamped(control=Control(thrust=bad)))


def test_numbers_in_lists_must_be_finite():
    transform = TransformStamped()
    assert is_finite(TFMessage([transform]))
    transform.transform.translation.x = math.nan
    assert not is_finite(TFMessage([transform]))
    assert is_finite(Float32MultiArray(data=(1.0, 2.0)))
    assert not is_finite(Float32MultiArray(data=(1.0, math.nan)))
    assert not is_finite(Float32MultiArray(data=np.array([math.inf])))


def test_text_and_stamps_are_no_numbers():
    assert is_finite(String("nan"))
    assert is_finite(Header(frame_id="inf"))
