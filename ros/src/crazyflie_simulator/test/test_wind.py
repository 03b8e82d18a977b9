"""Wind and gusts against their statistics."""

import numpy as np
import pytest

from crazyflie_simulator.wind import Wind


def velocities(wind, times):
    return np.array([wind.velocity(t) for t in times])


def test_no_wind_by_default():
    assert Wind().velocity(3.0) == (0.0, 0.0, 0.0)


def test_constant_without_gust():
    wind = Wind(mean=(1.0, -2.0, 0.5))
    assert wind.velocity(0.0) == wind.velocity(99.0) == (1.0, -2.0, 0.5)


def test_gusts_have_the_mean_and_the_spread_asked_for():
    samples = velocities(Wind((1.0, 0.0, -1.0), gust=0.5, gust_time=0.7), np.arange(0, 3000, 0.31))
    np.testing.assert_allclose(samples.mean(axis=0), [1.0, 0.0, -1.0], atol=0.03)
    np.testing.assert_allclose(samples.std(axis=0), 0.5, rtol=0.05)
    correlation = np.corrcoef(samples.T)
    np.testing.assert_allclose(correlation, np.eye(3), atol=0.1)


@pytest.mark.parametrize("lag", [0.2, 0.7, 1.4])
def test_gusts_are_correlated_over_their_time(lag):
    wind = Wind(gust=1.0, gust_time=0.7, seed=5)
    times = np.arange(0, 2000, 0.23)
    now, later = velocities(wind, times), velocities(wind, times + lag)
    np.testing.assert_allclose((now * later).mean(axis=0), np.exp(-lag / 0.7), atol=0.08)


def test_the_seed_decides():
    times = np.arange(0.0, 1.0, 0.1)
    same = velocities(Wind(gust=1.0, seed=1), times), velocities(Wind(gust=1.0, seed=1), times)
    np.testing.assert_array_equal(*same)
    assert not np.array_equal(same[0], velocities(Wind(gust=1.0, seed=2), times))
