"""Velocities: the oscillator, chance, the services, and answers that cannot be used."""

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_sweep.sweep_node import VelocityServerNode
from crazyflie_sweep.velocities import VelocitySource, oscillator_velocity, random_velocities
from crazyflie_tutorial_msgs.srv import VelocityAtRequest, VelocityRequest
from crazyflie_utils import ServiceError
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.testing import FakeProcess


@pytest.mark.parametrize(
    ("x", "velocity"),
    # By hand: the sine of 0, 30, 90 and 180 degrees.
    [(2.0, 0.1), (2.0 + 7.0 / 6.0, 1.1), (5.5, 2.1), (9.0, 0.1)],
)
def test_oscillator(x, velocity):
    assert oscillator_velocity(x) == pytest.approx(velocity)


@pytest.mark.parametrize("x", [1.99, 9.01, -math.inf, math.nan])
def test_oscillator_has_an_interval(x):
    with pytest.raises(RefusalError, match="expected 2 to 9"):
        oscillator_velocity(x)


@given(st.floats(-10.0, 10.0), st.floats(0.0, 5.0))
def test_random_velocities_are_in_the_interval(least, width):
    source = random.Random(1)
    for _ in range(20):
        assert all(
            least <= v <= least + width for v in random_velocities(least, least + width, source)
        )


def test_random_velocities_fill_the_interval():
    source = random.Random(1)
    drawn = [v for _ in range(500) for v in random_velocities(0.0, 1.0, source)]
    assert min(drawn) < 0.02
    assert max(drawn) > 0.98
    assert sum(drawn) / len(drawn) == pytest.approx(0.5, abs=0.03)


@pytest.fixture
def process():
    fake = FakeProcess()
    assert fake.launch(VelocityServerNode(), "/velocity_server", {"seed": 7})
    return fake


def test_services(process):
    assert process.call("/oscillator", VelocityAtRequest(5.5)).vel == pytest.approx(2.1)
    answers = [process.call("/velocity", VelocityRequest(0.2, 0.4)) for _ in range(5)]
    numbers = [number for answer in answers for number in (answer.x, answer.z)]
    assert len(set(numbers)) == 10
    assert all(0.2 <= number <= 0.4 for number in numbers)


def test_services_refuse_with_the_reason(process):
    with pytest.raises(ServiceError, match="x is 1; expected 2 to 9"):
        process.call("/oscillator", VelocityAtRequest(1.0))
    for least, most in ((1.0, 0.0), (math.nan, 1.0), (0.0, math.inf)):
        with pytest.raises(ServiceError, match="expected finite min <= max"):
            process.call("/velocity", VelocityRequest(least, most))


def test_an_answer_is_used_until_it_is_old():
    source = VelocitySource(limit=0.5, most=3.0, start=10.0)
    assert source.velocity(10.4) is None
    assert source.reason == ""
    source.answer(1.5, 11.0)
    assert source.velocity(11.5) == 1.5
    assert source.velocity(11.51) is None
    assert source.reason == "it has not answered for 0.5 s"


def test_one_failure_is_bridged():
    source = VelocitySource(limit=0.5, most=3.0, start=10.0)
    source.answer(1.5, 11.0)
    source.fail("there is no service")
    assert source.velocity(11.4) == 1.5
    assert source.velocity(11.6) is None
    assert source.reason == "there is no service"
    source.answer(1.0, 12.0)
    assert source.velocity(12.0) == 1.0
    assert source.reason == ""


@pytest.mark.parametrize("nonsense", [0.0, -1.0, 3.1, math.inf, math.nan])
def test_nonsense_is_not_used_and_ends_what_was_before(nonsense):
    source = VelocitySource(limit=0.5, most=3.0, start=10.0)
    source.answer(1.5, 11.0)
    source.answer(nonsense, 11.1)
    assert source.velocity(11.1) is None
    assert source.reason == f"it answers {nonsense:g}, which is not > 0 and <= 3"


def test_a_clock_that_is_reset_does_not_make_an_answer_last_for_ever():
    source = VelocitySource(limit=0.5, most=3.0, start=100.0)
    source.answer(1.5, 100.0)
    assert source.velocity(1.0) == 1.5
    assert source.velocity(1.6) is None
