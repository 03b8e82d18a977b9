"""Values in messages."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_utils.text import shortened, shown

NESTED: list = []
for _ in range(100):
    NESTED = [NESTED] * 10


@pytest.mark.parametrize(
    "value", ["much", "a\nb", -1, 2.5, True, None, [1.0, 2.0, "x"], {"a": [1]}, (1, 2), 10**30]
)
def test_a_short_value_is_shown_as_it_is(value):
    assert shown(value) == repr(value)


@pytest.mark.parametrize(
    ("value", "part"),
    [
        ("x" * 200_000, "'xxxx"),
        (b"x" * 200_000, "b'xxx"),
        (1 << 200_000, "an integer of 200001 bits"),
        (list(range(200_000)), "[0, 1, 2"),
        ({str(k): k for k in range(200_000)}, "{'0': 0"),
        (NESTED, "[["),
        ("\0" * 60, r"'\x00"),
    ],
    ids=map(str, range(7)),
)
def test_a_long_value_is_cut(value, part):
    text = shown(value)
    assert text.startswith(part)
    assert len(text) <= 80


@given(st.text(), st.integers(3, 50))
def test_a_text_is_as_long_as_it_may_be(text, length):
    short = shortened(text, length)
    assert len(short) <= length
    assert (short == text) == (len(text) <= length) or "..." in text
