"""On the ground, too, a batch flies as the nodes' classes have one vehicle fly."""

import numpy as np
import pytest
from one_by_one import fly_one, prepare

from crazyflie_batch import Controller, FiniteDifferences, Measurement
from crazyflie_batch.batch import fly
from crazyflie_batch.simulation import coupled_7d, near_hover

FALLING = np.zeros((4, 7))
FALLING[1, [0, 3]] = -0.25, -1.0
"""Gains that steer, but do not hold the height."""


@pytest.mark.parametrize("model", [near_hover, coupled_7d])
def test_vehicles_that_meet_the_ground_slide_and_stop_alike(model):
    goals = np.zeros((3, 7))
    goals[:, 0] = 4.0, -2.0, 0.0
    batch = prepare(
        model(),
        Controller(FALLING, u_ref=(0.0, 0.0, 0.0, 4.0)),
        FiniteDifferences(),
        (0.0, 0.0, 0.5),
        3,
        goal=goals,
        duration=1.5,
        period=0.01,
        settle_time=0.0,
        measurement=Measurement(),
        seed=1,
        first=0,
    )
    flights = fly(batch, record=True, threads=1)
    for index in range(3):
        states, _ = fly_one(batch, index)
        np.testing.assert_allclose(flights.states[:, index], states[:-1], atol=1e-9)
    assert flights.states[-1, :, 2].tolist() == [0.0] * 3
    assert np.max(np.abs(np.diff(flights.states[-20:, :, 0], axis=0))) < 1e-3
