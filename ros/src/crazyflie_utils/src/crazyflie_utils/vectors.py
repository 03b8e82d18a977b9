"""Messages to numpy vectors and back.

Control and state messages hold nothing but float64 fields, and the order of
their fields is the order of the vectors in every algorithm. So one pair of
functions serves all of them, and a new message needs none.
"""

import math

import numpy as np


def to_vector(message) -> np.ndarray:
    """Return the fields of a flat message as a vector.

    Parameters
    ----------
    message : genpy.Message
        All fields float64, such as crazyflie_msgs/Control.

    Returns
    -------
    ndarray, shape (number of fields,)
        In the order of the message definition; units as there.
    """
    return np.array([getattr(message, field) for field in message.__slots__])


def from_vector(message_type: type, vector):
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


def is_finite(message) -> bool:
    """Tell whether every number of a message, nested ones included, is finite."""
    for field in message.__slots__:
        value = getattr(message, field)
        if isinstance(value, float):
            if not math.isfinite(value):
                return False
        elif hasattr(value, "__slots__") and not is_finite(value):
            return False
    return True
