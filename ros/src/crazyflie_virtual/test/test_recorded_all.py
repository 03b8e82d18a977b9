"""No recorded scenario is left out."""

import pathlib
import re

import pytest
from recording import scenarios

_TEXT = "".join(
    path.read_text()
    for path in pathlib.Path(__file__).parent.glob("test_recorded_*.py")
    if path.name != pathlib.Path(__file__).name
)

NAMES = set(re.findall(r'"([\w.]+)"', _TEXT))


@pytest.mark.parametrize("name", scenarios())
def test_a_test_flies_it_again(name):
    assert name in NAMES
