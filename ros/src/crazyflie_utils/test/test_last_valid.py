"""A last good value and how long it stands in."""

import pytest

from crazyflie_model.limits import LEVEL_AGE
from crazyflie_utils.last_valid import HOLD_LIMIT, LastValid


def test_limit_is_the_firmwares():
    assert HOLD_LIMIT == LEVEL_AGE


def test_is_nothing_at_first():
    assert LastValid().value(0.0) is None


def test_stays_without_bad_values():
    last = LastValid()
    last.update("a")
    assert last.value(1e9) == "a"


def test_stays_for_the_limit_after_the_first_bad_value():
    last = LastValid()
    last.update("a")
    for time in (10.0, 10.2, 10.4):
        last.invalidate(time)
    assert last.value(10.49) == "a"
    assert last.value(10.5) is None
    assert last.value(20.0) is None


def test_a_good_value_ends_the_wait():
    last = LastValid(limit=2.0)
    last.update("a")
    last.invalidate(10.0)
    last.update("b")
    assert last.value(100.0) == "b"
    last.invalidate(100.0)
    assert last.value(101.9) == "b"
    assert last.value(102.0) is None
    last.update("c")
    assert last.value(103.0) == "c"


def test_bad_before_good_leaves_nothing():
    last = LastValid()
    last.invalidate(1.0)
    assert last.value(1.1) is None


def test_bad_values_after_a_reset_of_time_count():
    last = LastValid()
    last.update("a")
    last.invalidate(1000.0)
    last.invalidate(1.0)
    assert last.value(1.4) == "a"
    assert last.value(1.5) is None


@pytest.mark.parametrize("value", [0, 0.0, False])
def test_falsehood_is_a_value(value):
    last = LastValid()
    last.update(value)
    assert last.value(0.0) is value
