"""Numbers that may go over the link."""

import math

from crazyflie_link.errors import ValueRangeError

#: Numbers go over the link in single precision; a smaller one may arrive as 0.
SMALLEST_FLOAT, LARGEST_FLOAT = 1.2e-38, 3.4e38

#: A shorter duration (s), or a smaller time scale, is a mistake: the planner, at 100 Hz, would ask
#: for the end of the motion at once.
MIN_DURATION = 0.01


def check_finite(what: str, *values: float) -> None:
    """Raise `ValueRangeError` unless all values are finite, in single precision, too."""
    for value in values:
        if not math.isfinite(value):
            raise ValueRangeError(f"{what}: {value} is not finite")
        if abs(value) > LARGEST_FLOAT:
            raise ValueRangeError(f"{what}: {value:g} is beyond +-{LARGEST_FLOAT:g}")


def check_positive(what: str, value: float) -> None:
    """Raise `ValueRangeError` unless the value is positive and finite, in single precision, too."""
    if not SMALLEST_FLOAT <= value <= LARGEST_FLOAT:
        raise ValueRangeError(
            f"{what} is {value:g}; expected a finite number above 0 ({SMALLEST_FLOAT:g} to "
            f"{LARGEST_FLOAT:g})"
        )


def check_duration(what: str, value: float) -> None:
    """Raise `ValueRangeError` unless a duration (s) or time scale is finite and long enough."""
    if not MIN_DURATION <= value <= LARGEST_FLOAT:
        raise ValueRangeError(
            f"{what} is {value:g}; expected a finite number of at least {MIN_DURATION:g}"
        )


def check_byte(what: str, value: int) -> None:
    """Raise `ValueRangeError` unless the value fits in a byte."""
    if not 0 <= value <= 255:
        raise ValueRangeError(f"{what} is {value}; expected 0 to 255")
