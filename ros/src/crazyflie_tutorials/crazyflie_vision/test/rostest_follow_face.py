"""A vehicle follows the picture of a face."""

import numpy as np
import pytest
from following import fly


@pytest.fixture(scope="module")
def flight():
    # A vehicle that drifts to the edge of the picture loses it after two minutes.
    return fly("face", begin=3.0, end=180.0)


def test_the_face_stays_in_the_middle_of_the_image(flight):
    print("pixels:", flight.pixel_errors.mean(), flight.pixel_errors.max(), flight.gaps.max())
    assert flight.gaps.max() < 0.5
    assert flight.pixel_errors.mean() < 30.0


def test_the_vehicle_keeps_its_distance(flight):
    print("metres:", flight.distance_errors.mean(), flight.distance_errors.max())
    assert flight.distance_errors.mean() < 0.2


def test_it_had_to_fly_for_that(flight):
    assert np.ptp(flight.path, axis=0).max() > 0.1


def test_lands_though_the_face_moves_on(flight):
    assert flight.height == pytest.approx(0.0, abs=0.05)
