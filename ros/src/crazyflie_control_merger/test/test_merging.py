"""Merging against the formula, entry by entry."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from crazyflie_control_merger.merging import LQR, MERGE, MODES, NO_YAW_ENTRIES, PRIORITIZED, Merger

controls = arrays(float, 4, elements=st.floats(-20.0, 20.0))
priorities = st.floats(0.0, 1.0)
REGULAR = np.array([0.1, -0.2, 0.3, 9.0])
PUSH = np.array([-0.2, 0.2, 1.0, 12.0])


def merged(mode, regular, prioritized, priority):
    merger = Merger()
    merger.prioritize(prioritized, priority, 10.0)
    return merger.merged(regular, 10.0, mode)


@given(controls, controls, priorities)
def test_merge_is_the_weighted_mean(regular, prioritized, p):
    expected = [(1.0 - p) * r + p * q for r, q in zip(regular, prioritized, strict=True)]
    np.testing.assert_allclose(merged(MERGE, regular, prioritized, p), expected)


@given(controls, controls, priorities)
def test_merge_is_never_outside_its_two_controls(regular, prioritized, p):
    u = merged(MERGE, regular, prioritized, p)
    assert (u >= np.minimum(regular, prioritized) - 1e-9).all()
    assert (u <= np.maximum(regular, prioritized) + 1e-9).all()


@given(controls, controls, priorities)
def test_lqr_and_prioritized_are_the_two_ends(regular, prioritized, p):
    np.testing.assert_array_equal(merged(LQR, regular, prioritized, p), regular)
    np.testing.assert_array_equal(merged(PRIORITIZED, regular, prioritized, p), prioritized)
    np.testing.assert_array_equal(merged(MERGE, regular, prioritized, 0.0), regular)
    np.testing.assert_array_equal(merged(MERGE, regular, prioritized, 1.0), prioritized)


@given(controls, arrays(float, 3, elements=st.floats(-20.0, 20.0)), priorities)
def test_without_yaw_the_yaw_rate_stays_regular(regular, prioritized, p):
    merger = Merger(NO_YAW_ENTRIES)
    merger.prioritize(prioritized, p, 0.0)
    roll, pitch, yaw_dot, thrust = merger.merged(regular, 0.0, MERGE)
    assert yaw_dot == regular[2]
    mixed = (1.0 - p) * regular[[0, 1, 3]] + p * prioritized
    np.testing.assert_allclose([roll, pitch, thrust], mixed)


@pytest.mark.parametrize(("priority", "end"), [(-0.5, REGULAR), (1.5, PUSH), (math.inf, PUSH)])
def test_priority_is_clipped(priority, end):
    np.testing.assert_array_equal(merged(MERGE, REGULAR, PUSH, priority), end)


@pytest.mark.parametrize("mode", MODES)
def test_without_a_prioritized_control_the_regular_one_is_left_alone(mode):
    np.testing.assert_array_equal(Merger().merged(REGULAR, 0.0, mode), REGULAR)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("age", [0.51, 100.0, -0.01])
def test_a_stale_prioritized_control_is_no_longer_mixed_in(mode, age):
    merger = Merger()
    merger.prioritize(PUSH, 1.0, 10.0)
    np.testing.assert_array_equal(merger.merged(REGULAR, 10.0 + age, mode), REGULAR)


def test_it_counts_for_half_a_second_after_each():
    merger = Merger()
    for time in (10.0, 10.4):
        merger.prioritize(PUSH, 1.0, time)
    np.testing.assert_array_equal(merger.merged(REGULAR, 10.89, MERGE), PUSH)
    np.testing.assert_array_equal(merger.merged(REGULAR, 10.91, MERGE), REGULAR)


def test_inputs_are_left_alone():
    regular, push = REGULAR.copy(), PUSH.copy()
    merged(MERGE, regular, push, 0.5)
    np.testing.assert_array_equal(regular, REGULAR)
    np.testing.assert_array_equal(push, PUSH)
