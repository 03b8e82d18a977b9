"""A last good value and how long it stands in."""

import pytest

from crazyflie_utils.held import HOLD_LIMIT, Held


def test_limit_is_the_firmwares():
    assert HOLD_LIMIT == 0.5


def test_is_nothing_at_first():
    assert Held().value(0.0) is None


def test_stays_without_bad_values():
    held = Held()
    held.good("a")
    assert held.value(1e9) == "a"


def test_stays_for_the_limit_after_the_first_bad_value():
    held = Held()
    held.good("a")
    for time in (10.0, 10.2, 10.4):
        held.bad(time)
    assert held.value(10.49) == "a"
    assert held.value(10.5) is None
    assert held.value(20.0) is None


def test_a_good_value_ends_the_wait():
    held = Held(limit=2.0)
    held.good("a")
    held.bad(10.0)
    held.good("b")
    assert held.value(100.0) == "b"
    held.bad(100.0)
    assert held.value(101.9) == "b"
    assert held.value(102.0) is None
    held.good("c")
    assert held.value(103.0) == "c"


def test_bad_before_good_leaves_nothing():
    held = Held()
    held.bad(1.0)
    assert held.value(1.1) is None


def test_bad_values_after_a_reset_of_time_count():
    held = Held()
    held.good("a")
    held.bad(1000.0)
    held.bad(1.0)
    assert held.value(1.4) == "a"
    assert held.value(1.5) is None


@pytest.mark.parametrize("value", [0, 0.0, False])
def test_falsehood_is_a_value(value):
    held = Held()
    held.good(value)
    assert held.value(0.0) is value
