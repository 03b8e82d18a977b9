"""Messages to numpy vectors and back.

Control and state messages hold nothing but float64 fields, and the order of
their fields is the order of the vectors in every algorithm. So one pair of
functions serves all of them, and a new message needs none.
"""

import math
from collections.abc import Sequence

import genpy
import numpy as np
from numpy.typing import NDArray


def to_vector(message: genpy.Message) -> NDArray[np.float64]:
    """Return the fields of a flat message as a vector.

    Parameters
    ----------
    message : genpy.Message
        All fields float64, such as crazyflie_msgs/Control.

    Returns
    -------
    ndarray, shape (number of fields,)
        In the order of the message definition; units as there.

    Raises
    ------
    TypeError
        A field is not a number but, say, a header.
    """
    return np.array([getattr(message, field) for field in message.__slots__], dtype=float)


def from_vector(
    message_type: type[genpy.Message], vector: Sequence[float] | NDArray[np.float64]
) -> genpy.Message:
    """Return a flat message with the entries of a vector.

    Parameters
    ----------
    message_type : type
        A message class whose fields are all float64.
    vector : array_like, shape (number of fields,)
        In the order of the message definition.

    Raises
    ------
    ValueError
        The vector's length is not the message's number of fields.
    """
    fields = message_type.__slots__
    if len(vector) != len(fields):
        raise ValueError(
            f"{message_type._type} has {len(fields)} fields {tuple(fields)}, "
            f"got a vector of {len(vector)}"
        )
    return message_type(*map(float, vector))


def is_finite(message: genpy.Message) -> bool:
    """Tell whether every number of a message, of nested ones and of lists, is finite."""
    return all(_is_finite(getattr(message, field)) for field in message.__slots__)


def _is_finite(value):
    if isinstance(value, (float, np.floating)):
        return math.isfinite(value)
    if hasattr(value, "__slots__"):
        return is_finite(value)
    if isinstance(value, (list, tuple, np.ndarray)):
        return all(map(_is_finite, value))
    return True
