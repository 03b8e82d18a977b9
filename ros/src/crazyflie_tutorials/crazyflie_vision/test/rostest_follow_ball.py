"""A vehicle follows a ball whose path is known."""

import numpy as np
import pytest
from following import fly


@pytest.fixture(scope="module")
def flight():
    return fly("ball", begin=4.0, end=13.0)


def test_the_ball_stays_in_the_middle_of_the_image(flight):
    print("pixels:", flight.pixel_errors.mean(), flight.pixel_errors.max(), flight.gaps.max())
    assert flight.gaps.max() < 0.2
    assert flight.pixel_errors.mean() < 20.0
    assert flight.pixel_errors.max() < 50.0


def test_the_vehicle_keeps_its_distance(flight):
    print("metres:", flight.distance_errors.mean(), flight.distance_errors.max())
    assert flight.distance_errors.mean() < 0.17
    assert flight.distance_errors.max() < 0.3


def test_it_had_to_fly_for_that(flight):
    assert np.ptp(flight.path, axis=0).max() > 0.5


def test_lands_though_the_ball_flies_on(flight):
    assert flight.height == pytest.approx(0.0, abs=0.05)
