"""Step 1: the velocity."""

import pytest

from crazyflie_utils.refusal import RefusalError
from my_sweep.oscillator import service_position, velocity


@pytest.mark.parametrize(("x", "expected"), [(2.0, 0.1), (5.5, 2.1), (9.0, 0.1), (3.75, 1.51421)])
def test_is_that_of_an_oscillator(x, expected):
    assert velocity(x) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("x", [1.9, 9.1, float("nan")])
def test_outside_there_is_none(x):
    with pytest.raises(RefusalError, match="expected 2 to 9"):
        velocity(x)


@pytest.mark.parametrize(("x", "expected"), [(0.0, 2.0), (1.5, 5.5), (3.0, 9.0), (4.0, 9.0)])
def test_the_lane_is_as_long_as_the_oscillator(x, expected):
    assert service_position(x, 0.0, 3.0) == pytest.approx(expected)
