"""Numbers that may go over the link."""

import math

from crazyflie_py.errors import ValueRangeError


def check_finite(what: str, *values: float) -> None:
    """Raise `ValueRangeError` unless all values are finite."""
    for value in values:
        if not math.isfinite(value):
            raise ValueRangeError(f"{what}: {value} is not finite")


def check_positive(what: str, value: float) -> None:
    """Raise `ValueRangeError` unless the value is finite and greater than 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise ValueRangeError(f"{what}: {value} is not a positive number")


def check_byte(what: str, value: int) -> None:
    """Raise `ValueRangeError` unless the value fits in a byte."""
    if not 0 <= value <= 255:
        raise ValueRangeError(f"{what} is {value}; expected 0 to 255")
