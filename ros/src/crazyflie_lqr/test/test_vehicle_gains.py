"""Gains for a vehicle with a model."""

import dataclasses
import math

import numpy as np
import pytest

from crazyflie_lqr import vehicle_gains
from crazyflie_lqr.design import DesignError
from crazyflie_lqr.linear_feedback_node import GAINS
from crazyflie_lqr.vehicle_gains import LEAST_DELAY, LEAST_MODULUS, design, gains
from crazyflie_model.quadrotor import CRAZYFLIE, TYPES
from crazyflie_model.units import GRAVITY


def vehicle(delay, lag):
    return dataclasses.replace(CRAZYFLIE, delay=delay, roll_lag=lag, pitch_lag=lag, yaw_lag=lag)


@pytest.mark.parametrize(("delay", "lag"), [(0.0, 0.03), (0.03, 0.167), (0.06, 0.12)])
def test_they_bear_more_delay_than_the_vehicle_has(delay, lag):
    _, loops = design(vehicle(delay, lag))
    assert min(loop.delay for loop in loops) >= LEAST_DELAY
    assert min(loop.modulus for loop in loops) >= LEAST_MODULUS


def test_a_vehicle_that_answers_later_is_flown_more_slowly():
    # The bandwidth of the horizontal position loop, rad/s.
    widths = [math.sqrt(GRAVITY * abs(gains(vehicle(delay, 0.08))[1, 0])) for delay in (0.0, 0.06)]
    assert widths == sorted(widths, reverse=True)
    assert widths[0] > 1.2 * widths[1]


def test_where_no_gains_bear_enough_it_says_so(monkeypatch):
    monkeypatch.setattr(vehicle_gains, "LEAST_MODULUS", 0.999)
    with pytest.raises(
        DesignError, match="no gains tolerate a delay of 0 ms and lags of 100, 100, 100"
    ):
        design(vehicle(0.0, 0.1))


def test_a_controller_takes_a_model_for_a_gain_file(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("lag: {roll: 0.05, pitch: 0.05}\ndelay: 0.03\n")
    found = GAINS(str(path))
    assert found.shape == (4, 7)
    np.testing.assert_array_equal(found != 0.0, gains(CRAZYFLIE) != 0.0)
    np.testing.assert_array_equal(GAINS("brushless"), gains(TYPES["brushless"]))
    path.write_text("mass: 33\n")
    with pytest.raises(ValueError, match="mass .* is 33; expected"):
        GAINS(str(path))
