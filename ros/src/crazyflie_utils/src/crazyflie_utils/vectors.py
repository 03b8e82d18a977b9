"""Messages to numpy vectors and back.

Control and state messages have float64 fields only, in the order of the vectors of algorithms.
"""

import functools
import math
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, TypeVar

import genpy
import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Header

M = TypeVar("M", bound=genpy.Message)


def stamped(message_type: type[M], stamp: genpy.Time, frame_id: str = "", **fields: Any) -> M:
    """Return a message with a header and all its other fields.

    Several times faster than the type's own constructor.
    """
    header = object.__new__(Header)
    header.seq, header.stamp, header.frame_id = 0, stamp, frame_id
    message = object.__new__(message_type)
    message.header = header
    for field, value in fields.items():
        setattr(message, field, value)
    return message


def to_tuple(message: genpy.Message) -> tuple[float, ...]:
    """Return the fields of a flat message: more than one, all float64, such as a Control."""
    message_type: Any = type(message)
    return _getter(message_type)(message)


@functools.cache
def _getter(message_type: Any) -> Callable[[genpy.Message], tuple[float, ...]]:
    return attrgetter(*message_type.__slots__)


def to_vector(message: genpy.Message) -> NDArray[np.float64]:
    """Return the fields of a flat message, shape (number of fields,), units as there.

    TypeError or ValueError if a field is not a number, for example a header or a list.
    """
    return np.array([getattr(message, field) for field in message.__slots__], dtype=float)


def from_vector(
    message_type: type[genpy.Message], vector: Sequence[float] | NDArray[np.float64]
) -> genpy.Message:
    """Return a flat message with the entries of a vector; ValueError if their numbers differ."""
    fields = message_type.__slots__
    if len(vector) != len(fields):
        raise ValueError(
            f"{message_type._type} has {len(fields)} fields {tuple(fields)}, "
            f"got a vector of {len(vector)}"
        )
    # The type's __init__ checks each field several times.
    message = object.__new__(message_type)
    # As many as there are fields; `strict` would take a quarter of the time.
    for field, value in zip(fields, map(float, vector)):  # noqa: B905
        setattr(message, field, value)
    return message


def is_finite(message: genpy.Message) -> bool:
    """Return whether every number of a message, of nested ones and of lists, is finite."""
    message_type: Any = type(message)
    # If the sum is finite, so are the numbers; if it overflows, each one is checked.
    if _is_flat(message_type) and math.isfinite(sum(to_tuple(message), 0.0)):
        return True
    return all(_is_finite(getattr(message, field)) for field in message.__slots__)


def number_getter(
    message_type: Any, field: str
) -> Callable[[genpy.Message], tuple[float, ...]] | None:
    """Return a function for the numbers of a field of a message; None if the field is not flat."""
    inner_type: Any = type(getattr(message_type(), field))
    if not (hasattr(inner_type, "_slot_types") and _is_flat(inner_type)):
        return None
    return attrgetter(*(f"{field}.{each}" for each in inner_type.__slots__))


@functools.cache
def _is_flat(message_type):
    types = message_type._slot_types
    return len(types) > 1 and all(each == "float64" for each in types)


def _is_finite(value):
    # numpy's float64 is a float.
    if isinstance(value, float):
        return math.isfinite(value)
    if hasattr(value, "__slots__"):
        return is_finite(value)
    if isinstance(value, (list, tuple)):
        return all(map(_is_finite, value))
    # Slower path for arrays and numpy's single precision.
    return _is_finite(value.tolist()) if hasattr(value, "tolist") else True
