"""Cells that a disc passes over."""

import math

import pytest

from crazyflie_sweep.sweep_parameters import Area
from crazyflie_sweep.sweeper import Coverage

AREA = Area(x_min=0.0, x_max=2.0, y_min=-1.0, y_max=0.0)


def test_nothing_is_covered_at_first():
    coverage = Coverage(AREA, 0.1, 0.5)
    assert coverage.share == 0.0
    assert coverage.middles(covered=False).shape == (200, 2)
    assert coverage.middles(covered=True).shape == (0, 2)


def test_a_disc_covers_its_area():
    coverage = Coverage(AREA, 0.01, 0.8)
    assert coverage.add((1.0, -0.5, 1.0))
    assert coverage.share == pytest.approx(math.pi * 0.4**2 / 2.0, rel=0.01)


def test_the_same_place_again_is_nothing_new():
    coverage = Coverage(AREA, 0.1, 0.5)
    coverage.add((1.0, -0.5, 1.0))
    share = coverage.share
    assert not coverage.add((1.0, -0.5, 2.0))
    assert not coverage.add((10.0, -0.5, 1.0))
    assert coverage.share == share


def test_cells_fill_the_area_when_their_width_does_not_divide_it():
    coverage = Coverage(AREA, 0.3, 0.5)
    assert coverage.cell_size == pytest.approx((2.0 / 7, 1.0 / 4))
    middles = coverage.middles(covered=False)
    assert middles.min(axis=0) == pytest.approx((1.0 / 7, -1.0 + 1.0 / 8))
    assert middles.max(axis=0) == pytest.approx((2.0 - 1.0 / 7, -1.0 / 8))
