"""The attitude and rate loops."""

import numpy as np
import pytest

from crazyflie_model import inner_loops
from crazyflie_model.elementwise import join, split
from crazyflie_model.units import GRAVITY, HOVER_PWM

LEVEL = (0.0, 0.0, 0.0)


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


def test_without_thrust_the_motors_are_off_and_the_loops_restart():
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


def test_the_least_thrust_turns_the_motors():
    np.testing.assert_allclose(commands([0.0, 0.0, 0.0, 0.5]), 0.5 / GRAVITY * HOVER_PWM)
