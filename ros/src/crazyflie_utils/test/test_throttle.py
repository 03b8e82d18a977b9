"""Limits against a flood of the log."""

from crazyflie_utils.context import Throttle


def test_a_key_passes_once_in_its_period():
    throttle = Throttle()
    assert throttle.passes("a", 1.0, 10.0)
    assert not throttle.passes("a", 1.0, 10.9)
    assert throttle.passes("b", 1.0, 10.9)
    assert throttle.passes("a", 1.0, 11.0)
    assert not throttle.passes("a", 1.0, 11.9)


def test_keys_without_end_are_neither_logged_nor_remembered_without_end():
    throttle = Throttle()
    passed = sum(throttle.passes(f"text {n}", 1.0, n * 1e-4) for n in range(100_000))
    assert 100 < passed < 1000
    assert len(throttle._allowed_from) < 100
