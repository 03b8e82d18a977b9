"""Mixing: directions, and what gives way at the limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_model.inner_loops import limit, mix
from crazyflie_model.limits import FULL_PWM

NUMBERS = st.floats(-1e5, 2e5)
OUTPUTS = st.tuples(*[st.floats(-5000.0, 5000.0)] * 3)


def test_directions():
    front_right, back_right, back_left, front_left = range(4)
    rolled = mix(100.0, 10.0, 0.0, 0.0)
    assert rolled[front_left] == rolled[back_left] > rolled[front_right] == rolled[back_right]
    # Positive about left is nose down.
    pitched = mix(100.0, 0.0, 10.0, 0.0)
    assert pitched[back_left] == pitched[back_right] > pitched[front_left] == pitched[front_right]
    # Less of the motors that turn counter-clockwise, 1 and 3, turns to the left.
    yawed = mix(100.0, 0.0, 0.0, 10.0)
    assert yawed[back_right] == yawed[front_left] > yawed[front_right] == yawed[back_left]


@given(st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS))
def test_motors_are_never_asked_for_what_they_cannot_do(requested):
    assert all(0.0 <= command <= FULL_PWM for command in limit(requested))


@given(thrust=st.floats(40000.0, 68000.0), outputs=OUTPUTS)
def test_attitude_comes_before_height(thrust, outputs):
    m1, m2, m3, m4 = limit(mix(thrust, *outputs))
    np.testing.assert_allclose(
        [m3 + m4 - m1 - m2, m2 + m3 - m1 - m4, m2 + m4 - m1 - m3],
        [2.0 * outputs[0], 2.0 * outputs[1], 4.0 * outputs[2]],
        atol=1e-6,
    )
    assert (m1 + m2 + m3 + m4) / 4.0 <= thrust + 1e-6


def test_idle_thrust():
    assert limit((0.0, 10.0, 5000.0, 0.0), idle=3000.0) == [3000.0, 3000.0, 5000.0, 3000.0]


@given(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=4))
def test_batches_are_like_single_vehicles(requests):
    batch = np.transpose(limit(list(np.transpose(requests))))
    assert batch == pytest.approx(np.array([limit(request) for request in requests]))
