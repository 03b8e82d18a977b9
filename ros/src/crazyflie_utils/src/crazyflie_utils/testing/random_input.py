"""Random input for tests with hypothesis: live parameters, and YAML files of users."""

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import strategies as st

from crazyflie_utils import ParameterError
from crazyflie_utils.parameters.declaration import Parameters
from crazyflie_utils.parameters.types import Number

_ODD = ("null", "[]", "{}", "-1", ".nan", "1e999", "x", "true", "2026-13-45", "&a", "*a", "!!set")


def legal_numbers(number: Number) -> st.SearchStrategy[float]:
    """Return a strategy for the values of a parameter: those at the ends of its range often."""
    low = max(number.minimum, number.above)
    low, high = max(low, -1.7e308), min(number.maximum, 1.7e308)
    is_excluded = low == number.above
    ends = [math.nextafter(low, math.inf) if is_excluded else low, high, 0.0, 5e-324, -5e-324]
    edges = [end for end in ends if low <= end <= high and not (is_excluded and end == low)]
    return st.sampled_from(edges) | st.floats(low, high, exclude_min=is_excluded)


def live_changes(parameters_type: type[Parameters]) -> st.SearchStrategy[dict[str, float]]:
    """Return a strategy for legal values of some of the live numbers, by their names."""
    values = {
        declaration.name: legal_numbers(declaration.type)
        for declaration in parameters_type.declarations()
        if declaration.live and isinstance(declaration.type, Number)
    }
    return st.fixed_dictionaries({}, optional=values)


@st.composite
def with_an_odd_word(draw: st.DrawFn, good: str) -> str:
    """Draw a YAML text in which one word of a valid one is replaced, which may be valid or not."""
    pieces = re.split(r"([\w.]+)", good)
    place = draw(st.integers(0, len(pieces) // 2 - 1)) * 2 + 1
    pieces[place] = draw(st.sampled_from(_ODD))
    return "".join(pieces)


def assert_refused(load: Callable[[Path], object], file: Path, line: int, expected: str) -> None:
    """Assert that ``load(file)`` names the file, a line, and what was expected there."""
    with pytest.raises(ParameterError) as error:
        load(file)
    text = str(error.value)
    assert f"{file}:{line}: " in text or f"({file}:{line})" in text
    assert expected in text


def assert_taken_or_refused(load: Callable[[Path], object], file: Path) -> None:
    """Assert that ``load(file)`` raises only errors that name the file."""
    try:
        load(file)
    except ParameterError as error:
        assert str(file) in str(error)
