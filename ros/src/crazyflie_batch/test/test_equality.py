"""A batch flies as the nodes' classes have one vehicle after the other fly, to within rounding."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from one_by_one import fly_one, prepare
from rospkg import RosPack

from crazyflie_batch import Controller, FiniteDifferences, Kalman, Measurement
from crazyflie_batch.batch import fly
from crazyflie_batch.simulation import coupled_7d, near_hover, quadrotor
from crazyflie_lqr.gain_file import load_matrix

SOFT = load_matrix(str(Path(RosPack().get_path("crazyflie_lqr"), "config", "K_soft.txt")), 4, 7)
N = 11  #: More than a group, and no whole number of groups.


def numbers(low, high):
    """Return a strategy for one number a vehicle."""
    return st.lists(st.floats(low, high), min_size=N, max_size=N)


def vectors(bounds):
    """Return a strategy for one vector a vehicle, each entry within +- its bound."""
    vector = st.tuples(*(st.floats(-bound, bound) for bound in bounds))
    return st.lists(vector, min_size=N, max_size=N)


@st.composite
def models(draw):
    """Return a model with parameters for N vehicles."""
    kind = draw(st.sampled_from([near_hover, coupled_7d, quadrotor, quadrotor]))
    if kind is not quadrotor:
        return kind()
    errors = numbers(-0.3, 0.3)
    return quadrotor(draw(errors), draw(errors), draw(vectors((1.0, 1.0, 0.5))))


@st.composite
def batches(draw):
    """Return flights of 0.6 s that differ in everything."""
    factors = np.array(draw(numbers(0.3, 2.0)))[:, np.newaxis, np.newaxis]
    start = np.array(draw(vectors((0.5, 0.5, 1.0)))) + (0.0, 0.0, draw(st.floats(0.0, 1.0)))
    noise = draw(st.sampled_from([0.0, 1e-3])), draw(st.sampled_from([0.0, 5e-3]))
    return prepare(
        draw(models()),
        Controller(
            SOFT * factors,
            integrator_k=draw(vectors((0.1, 0.1, 1.0))),
            integrator_limit=np.abs(draw(vectors((0.5, 0.5, 1.0)))),
        ),
        draw(
            st.sampled_from([FiniteDifferences(), Kalman(), Kalman(draw(numbers(1e-4, 1e-2)), 1.0)])
        ),
        start.clip((-1.0, -1.0, 0.0)),
        N,
        goal=draw(vectors((0.5, 0.5, 2.0, 0.3, 0.3, 0.3, 3.0))),
        duration=0.6,
        period=draw(st.sampled_from([0.004, 0.01])),
        settle_time=0.2,
        measurement=Measurement(*noise, draw(numbers(0.0, 0.05)), draw(numbers(0.0, 0.9))),
        seed=draw(st.integers(0, 2**32 - 1)),
        first=draw(st.integers(0, 1000)),
    )


def distance(a, b):
    """Return the largest difference, in relation to what is large."""
    return np.max(np.abs(a - b) / (1.0 + np.abs(b)))


@settings(phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(batches(), st.integers(0, N - 1))
def test_a_batch_flies_as_one_by_one(batch, index):
    flights = fly(batch, record=True, threads=1)
    states, controls = fly_one(batch, index)
    assert distance(flights.states[:, index], states[:-1]) < 1e-9
    assert distance(flights.x[index], states[-1]) < 1e-9
    assert distance(flights.controls[:, index], controls) < 1e-9


@pytest.mark.parametrize("estimator", [FiniteDifferences(), Kalman()])
def test_a_long_flight_stays_the_same_through_gaps_and_a_crash(estimator):
    goal = np.zeros((3, 7))
    goal[:, 2] = 1.0
    goal[2, 0] = 10.0
    batch = prepare(
        # The way to the third goal takes more tilt than this.
        dataclasses.replace(quadrotor([0.1, -0.1, 0.0]), max_tilt=0.26),
        Controller(SOFT, integrator_k=(-0.05, 0.05, -0.5), integrator_limit=(1.0, 1.0, 6.0)),
        estimator,
        (0.1, -0.1, 1.0),
        3,
        goal=goal,
        duration=5.0,
        period=0.01,
        settle_time=0.0,
        # The second vehicle gets poses at the ticks 5, 19, 288 and some later: between them the
        # watchdog levels it and stops its motors, and the integrator pauses.
        measurement=Measurement(1e-3, 1e-3, 0.02, [0.0, 0.985, 0.0]),
        seed=374,
        first=0,
    )
    flights = fly(batch, record=True, threads=1)
    assert flights.has_crashed.tolist() == [False, False, True]
    arrivals = np.flatnonzero(batch.noise_samples(1)[:, 6] >= 0.985)
    assert arrivals[:4].tolist() == [5, 19, 288, 377]
    for index in range(3):
        states, controls = fly_one(batch, index)
        assert distance(flights.states[:, index], states[:-1]) < 1e-9
        assert distance(flights.controls[:, index], controls) < 1e-9
