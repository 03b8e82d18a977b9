"""Checks of how loaders of users' YAML files refuse wrong ones."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import strategies as st

from crazyflie_utils import ParameterError

_ODD = ("null", "[]", "{}", "-1", ".nan", "1e999", "x", "true", "2026-13-45", "&a", "*a", "!!set")


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
