"""The attitude and rate loops, and the mixing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_simulator import inner_loops
from crazyflie_simulator.elementwise import join, split
from crazyflie_utils.units import GRAVITY, HOVER_PWM

LEVEL = (0.0, 0.0, 0.0)
OUTPUTS = st.tuples(*[st.floats(-40000.0, 40000.0)] * 3)


def commands(setpoint, attitude=LEVEL, rates=LEVEL):
    """Return the first motor commands of fresh loops, as an array."""
    _, motors = inner_loops.update(inner_loops.initial_memory(0.0), setpoint, attitude, rates)
    return np.array(motors)


def test_hover_is_the_same_for_all_motors():
    np.testing.assert_allclose(commands([0.0, 0.0, 0.0, GRAVITY]), HOVER_PWM)


@pytest.mark.parametrize(
    ("setpoint", "signs"),
    [
        ([0.01, 0.0, 0.0, GRAVITY], (-1, -1, 1, 1)),
        ([0.0, 0.01, 0.0, GRAVITY], (-1, 1, 1, -1)),
        ([0.0, 0.0, 1.0, GRAVITY], (-1, 1, -1, 1)),
    ],
    ids=["roll", "pitch", "yaw rate"],
)
def test_signs(setpoint, signs):
    np.testing.assert_array_equal(np.sign(commands(setpoint) - HOVER_PWM), signs)


def test_rates_are_damped():
    for axis, signs in enumerate([(1, 1, -1, -1), (1, -1, -1, 1), (1, -1, 1, -1)]):
        rates = np.eye(3)[axis] * 0.01
        motors = commands([0.0, 0.0, 0.0, GRAVITY], rates=rates.tolist())
        np.testing.assert_array_equal(np.sign(motors - HOVER_PWM), signs)


def test_one_sample_against_the_gains():
    # 0.01 rad of roll error asks for 6.0 * 0.01 rad/s (and its integral), and
    # each rad/s for 250 * 180 / pi PWM, half of it on each side.
    integral = 0.01 * 0.002
    rate = 6.0 * 0.01 + 3.0 * integral
    output = (250.0 * rate + 500.0 * rate * 0.002) * 180.0 / np.pi
    motors = commands([0.01, 0.0, 0.0, GRAVITY])
    np.testing.assert_allclose(motors - HOVER_PWM, np.array([-1, -1, 1, 1]) * output / 2.0)


def test_integrals_are_limited():
    memory = inner_loops.initial_memory(0.0)
    for _ in range(5000):
        memory, _ = inner_loops.update(memory, [0.5, -0.5, 3.0, GRAVITY], LEVEL, LEVEL)
    limits = np.deg2rad([20.0, -20.0, 360.0, 33.3, -33.3, 166.7])
    np.testing.assert_array_less(np.abs(memory[:6]), np.abs(limits) + 1e-12)
    np.testing.assert_allclose(memory[:2], limits[:2])


def test_without_thrust_the_motors_are_off_and_the_loops_begin_anew():
    memory, _ = inner_loops.update(
        inner_loops.initial_memory(0.0), [0.2, 0.1, 1.0, GRAVITY], LEVEL, LEVEL
    )
    memory, motors = inner_loops.update(memory, [0.2, 0.1, 1.0, 0.0], (0.0, 0.0, 0.7), LEVEL)
    assert motors == [0.0] * 4
    assert memory == inner_loops.initial_memory(0.7)


def test_the_heading_is_held_the_short_way_round():
    memory = inner_loops.initial_memory(3.1)
    _, motors = inner_loops.update(memory, [0.0, 0.0, 0.0, GRAVITY], (0.0, 0.0, -3.1), LEVEL)
    # The vehicle is 0.083 rad past the heading: it turns back, clockwise.
    assert motors[0] > HOVER_PWM > motors[1]


@given(thrust=st.floats(0.0, 16.0), outputs=OUTPUTS)
def test_motors_are_never_asked_for_what_they_cannot_do(thrust, outputs):
    motors = inner_loops.mix(thrust, *outputs)
    assert all(0.0 <= motor <= inner_loops.FULL_PWM for motor in motors)


@given(thrust=st.floats(9.0, 16.0), outputs=st.tuples(*[st.floats(-5000.0, 5000.0)] * 3))
def test_attitude_comes_before_height(thrust, outputs):
    m1, m2, m3, m4 = inner_loops.mix(thrust, *outputs)
    np.testing.assert_allclose(
        [m3 + m4 - m1 - m2, m2 + m3 - m1 - m4, m2 + m4 - m1 - m3],
        [2.0 * outputs[0], 2.0 * outputs[1], 4.0 * outputs[2]],
        atol=1e-6,
    )
    assert (m1 + m2 + m3 + m4) / 4.0 <= HOVER_PWM * thrust / GRAVITY + 1e-6


def test_batches_are_like_single_vehicles():
    rng = np.random.default_rng(7)
    memory, setpoint = rng.normal(size=(6, 9)) * 0.1, rng.normal(size=(6, 4)) + [0, 0, 0, 9]
    setpoint[0, 3] = 0.0
    attitude, rates = rng.normal(size=(6, 3)) * 0.2, rng.normal(size=(6, 3))
    batch = inner_loops.update(*map(split, (memory, setpoint, attitude, rates)))
    for k in range(6):
        single = inner_loops.update(
            *(split(part[k]) for part in (memory, setpoint, attitude, rates))
        )
        for whole, part in zip(batch, single, strict=True):
            np.testing.assert_allclose(join(whole)[k], part, rtol=1e-10, atol=1e-9)
