"""No recorded scenario is left out."""

import pathlib

import pytest
from recording import scenarios

TESTS = "".join(
    path.read_text()
    for path in pathlib.Path(__file__).parent.glob("test_recorded_*.py")
    if path.name != pathlib.Path(__file__).name
)


@pytest.mark.parametrize("name", scenarios())
def test_a_test_flies_it_again(name):
    assert f'"{name}"' in TESTS
