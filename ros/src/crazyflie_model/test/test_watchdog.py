"""The firmware's watchdog, for one vehicle and for many."""

import numpy as np
import pytest

from crazyflie_model.dynamics import watchdog_control

U = [0.1, -0.2, 0.3, 9.0]
LEVEL, OFF = [0.0, 0.0, 0.0, 9.0], [0.0, 0.0, 0.0, 0.0]
AGES = {0: U, 499: U, 500: LEVEL, 1999: LEVEL, 2000: OFF, 100_000: OFF}


@pytest.mark.parametrize("age", AGES)
def test_of_one_vehicle(age):
    assert watchdog_control(U, age) == AGES[age]


def test_of_many_vehicles():
    u = [np.full(len(AGES), each) for each in U]
    flown = watchdog_control(u, np.array(list(AGES)))
    assert np.stack(flown, axis=1).tolist() == list(AGES.values())
    np.testing.assert_array_equal(watchdog_control(u, np.array([0, 1, 2, 3, 4, 499])), u)
