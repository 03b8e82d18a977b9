"""The parts of the response monitor, against the formulas of its module and figures by hand."""

import math
from collections import deque

import numpy as np
import pytest

from crazyflie_state_estimator.control_response import (
    LAG,
    LAG_ERROR,
    MAX_GAP,
    ResponseMonitor,
    _Estimate,
    _significance,
    _Stay,
)

ZERO = (0.0, 0.0, 0.0)
PERIOD = 0.01
NOTHING_KNOWN = [[0.0] * 3] * 3


def estimate(time, velocity=ZERO):
    return _Estimate(time, ZERO, velocity, ZERO, NOTHING_KNOWN, ZERO, ZERO, ZERO)


# Blocks of poses.


def fed(period, count, begin=10.0, positions=lambda k: ZERO):
    monitor = ResponseMonitor()
    for k in range(count):
        monitor.update(begin + period * k, positions(k), ZERO)
    return monitor


def test_a_block_has_at_least_four_poses():
    assert fed(0.02, 4)._stay is None
    assert fed(0.02, 5)._stay == (pytest.approx(10.03), [0.0] * 3, 4)
    # The last pose of a block is the first of the next one.
    assert fed(0.02, 8)._stay.poses == 4
    assert fed(0.02, 9)._stay.poses == 8


def test_a_block_lasts_at_least_50_ms():
    assert fed(0.011, 5)._stay is None
    assert fed(0.011, 6)._stay == (pytest.approx(10.022), [0.0] * 3, 5)


@pytest.mark.parametrize(("gap", "kept"), [(0.0, 1), (-1.0, 1), (0.2, 2), (0.25, 1)])
def test_everything_restarts_after_a_gap(gap, kept):
    monitor = ResponseMonitor()
    monitor.update(1.0, ZERO, ZERO)
    monitor.update(1.0 + gap, ZERO, ZERO)
    assert len(monitor._block) == kept


def test_the_noise_is_that_about_a_straight_line():
    rng = np.random.default_rng(3)
    positions = rng.normal(0.0, 0.01, (5, 3)) + np.outer(np.arange(5), [0.1, -0.2, 0.3])
    monitor = fed(0.011, 6, positions=lambda k: positions[min(k, 4)])
    _, squares, *_ = np.polyfit(np.arange(5), positions, 1, full=True)
    # Degrees of freedom of 5 poses on 3 axes, less the line's 2 coefficients; averaged over 40
    # blocks.
    variance = squares.sum() / (3 * (5 - 2))
    assert monitor._noise == pytest.approx(math.sqrt(1e-6 + (variance - 1e-6) / 40.0))


def test_no_noise_is_less_than_a_tenth_of_a_millimetre():
    assert fed(0.02, 2000)._noise == 1e-4


# Estimates.


def test_the_integrals_of_the_commanded_acceleration():
    monitor = ResponseMonitor()
    monitor._estimate(5.0, ZERO, (2.0, 0.0, 0.0), 4)
    assert (monitor._commanded, monitor._speed, monitor._way) == ((2.0, 0.0, 0.0), ZERO, ZERO)
    monitor._estimate(5.2, ZERO, (0.0, 1.0, 0.0), 4)
    # First-order lag of 0.1 s: e^-2 of the step of the control is left.
    left = math.exp(-2.0)
    a = np.array([2.0 * left, 1.0 - left, 0.0])
    np.testing.assert_allclose(monitor._commanded, a)
    np.testing.assert_allclose(monitor._speed, 0.2 * a)
    np.testing.assert_allclose(monitor._way, 0.02 * a)
    monitor._estimate(5.7, ZERO, a, 4)
    np.testing.assert_allclose(monitor._speed, 0.7 * a)
    # 0.5 0.7^2.
    np.testing.assert_allclose(monitor._way, 0.245 * a)


def test_what_the_filter_finds_beside_the_control_is_the_disturbance():
    monitor = ResponseMonitor()
    for k in range(400):
        time = 0.05 * k
        monitor._estimate(time, (0.0, 0.0, -0.15 * time**2), (0.0, 0.0, 0.5), 4)
    last = monitor._latest[-1]
    # The vehicle sinks by 0.3 m/s^2 although 0.5 m/s^2 upwards are commanded.
    assert last.disturbance == pytest.approx([0.0, 0.0, -0.8], abs=1e-6)
    assert last.velocity[2] == pytest.approx(-0.3 * time, abs=1e-6)


def test_estimates_are_kept_for_three_seconds_four_a_second():
    monitor, kept = ResponseMonitor(), {}
    for k in range(28):
        monitor._estimate(0.125 * k, ZERO, ZERO, 4)
        kept[k] = [round(each.time * 8) for each in monitor._estimates]
    assert kept[9] == [1, 3, 5, 7, 9]
    assert kept[25] == list(range(1, 26, 2))
    assert kept[26] == list(range(3, 26, 2))


# Stays.


@pytest.mark.parametrize(("away", "stays"), [(0.0025, True), (0.0026, False)])
def test_poses_stay_to_within_their_noise(away, stays):
    monitor = ResponseMonitor()
    for k in range(5):
        monitor._estimate(0.1 * k, ZERO, ZERO, 4)
    monitor._stay = _Stay(0.0, ZERO, 16)
    # 0.3 mm and 4 standard deviations of 1 mm sqrt(1/4 + 1/16).
    monitor._update_stay(0.5, (0.0, away, 0.0), 4)
    if stays:
        assert monitor._stay == (0.0, pytest.approx((0.0, 0.2 * away, 0.0)), 20)
    else:
        assert monitor._stay == (0.5, (0.0, away, 0.0), 4)
        assert monitor._before.time == pytest.approx(0.3)


# Predictions.


@pytest.mark.parametrize("t", [0.1, 2.0])
def test_a_prediction_is_the_module_s_formula(t):
    rng = np.random.default_rng(1)
    p, v, d, a, speed, way, speed_now, way_now = rng.normal(size=(8, 3))
    root = 0.1 * rng.normal(size=(3, 3))
    P = root @ root.T  # noqa: N806
    monitor = ResponseMonitor()
    monitor._speed, monitor._way, monitor._noise = speed_now, way_now, 0.002
    start = _Estimate(1.0, p, v, d, P.tolist(), a, speed, way)
    place = (1.0, 2.0, 3.0)
    departure = monitor._predicted(t, start, monitor._offset(t, start, place), place)
    np.testing.assert_allclose(
        departure.position, p + v * t + d * t**2 / 2 + way_now - way - speed * t
    )
    np.testing.assert_allclose(departure.velocity, v + d * t + speed_now - speed)
    f = np.array([1.0, t, t**2 / 2.0])
    variance = (
        f @ P @ f
        + min(0.25**2 * t**5 / 20.0, (0.05 * t**2 / 2.0) ** 2)
        + 0.04**2 * np.sum((speed_now - speed - a * t) ** 2)
        # 3 mm, and 4 standard deviations of the mean of 4 poses.
        + (0.003 + 4.0 * 0.002 / 2.0) ** 2
    )
    assert monitor._deviation(t, start) ** 2 == pytest.approx(variance, rel=1e-9)


def test_the_uncertainty_of_the_disturbance_grows_no_further_than_it_changes():
    monitor = ResponseMonitor()
    monitor._noise = 0.0
    for t, variance in ((0.1, 0.25**2 * 0.1**5 / 20.0), (2.0, 0.1**2)):
        deviation = monitor._deviation(t, estimate(0.0))
        assert deviation**2 - 0.003**2 == pytest.approx(variance, rel=1e-6)


@pytest.mark.parametrize(
    ("duration", "position", "significance"),
    [
        (0.34, (0.3, 0.4, 0.0), 0.0),
        (0.35, (0.3, 0.4, 0.0), 0.5 / 0.55),
        (0.79, (0.3, 0.4, 0.0), 0.5 / 0.55),
        (0.8, (0.3, 0.4, 0.0), 0.5 / 0.36),
        (0.8, (0.3, 0.4, 1.2), 1.3 / 0.36),
        # Friction may hold a vehicle that is to sink.
        (0.8, (0.3, 0.4, -0.2), 0.3 / 0.36),
        (0.8, (0.3, 0.4, -0.6), 0.0),
    ],
)
def test_how_far_away_counts(duration, position, significance):
    assert _significance(duration, position, 0.1) == pytest.approx(significance)


def staying(before=None, estimates=()):
    """Return a monitor whose poses stay at 0 since a time of 0."""
    monitor = ResponseMonitor()
    monitor._stay = _Stay(0.0, ZERO, 100)
    monitor._before, monitor._estimates = before, deque(estimates)
    return monitor


def test_estimates_count_half_a_second_after_the_stop():
    fast, faster = (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)
    assert staying(estimates=[estimate(0.5, fast)])._departure(1.5) is None
    found = staying(estimates=[estimate(0.625, fast), estimate(0.75, faster)])._departure(1.75)
    # The one that is furthest away: 2 m/s for 1 s.
    assert found == ([2.0, 0.0, 0.0], [2.0, 0.0, 0.0])


def test_the_estimate_before_the_stop_counts_for_six_seconds():
    before = estimate(0.0, (1.0, 0.0, 0.0))
    assert staying(before)._departure(5.875) == ([5.875, 0.0, 0.0], [1.0, 0.0, 0.0])
    assert staying(before)._departure(6.0) is None
    assert staying()._departure(1.0) is None


def test_poses_that_have_not_stayed_yet_have_not_departed():
    assert ResponseMonitor()._departure(1.0) is None


# What the filter says beside that: the disturbance, and where the control leads.


def fly(monitor, begin, duration, position, acceleration, noise=0.0, period=PERIOD):
    """Show poses from a function of the time since ``begin``; return the last departure."""
    random = np.random.default_rng(1)
    departure = None
    for k in range(round(duration / period)):
        place = random.normal(position(k * period), noise)
        departure = monitor.update(begin + k * period, place.tolist(), acceleration) or departure
    return departure


def hovering(duration=3.0, noise=0.0005):
    monitor = ResponseMonitor()
    assert fly(monitor, 0.0, duration, lambda _: (0.0, 0.0, 1.0), ZERO, noise) is None
    return monitor


def test_what_the_poses_show_beside_the_control_is_the_disturbance():
    monitor = ResponseMonitor()
    # The vehicle sinks by 0.3 m/s^2 although 0.5 m/s^2 upwards are commanded.
    fly(monitor, 10.0, 2.0, lambda t: (0.0, 0.1 * t * t, -0.15 * t * t), (0.0, 0.0, 0.5))
    assert monitor.disturbance == pytest.approx((0.0, 0.2, -0.8), abs=0.01)


def test_a_disturbance_is_not_known_at_first_and_after_a_gap():
    monitor = ResponseMonitor()
    assert monitor.disturbance is None
    fly(monitor, 0.0, 0.1, lambda _: ZERO, ZERO)
    assert monitor.disturbance is None
    fly(monitor, 0.1, 1.0, lambda _: ZERO, ZERO)
    assert monitor.disturbance == pytest.approx(ZERO, abs=1e-6)
    monitor.update(1.09 + MAX_GAP, ZERO, ZERO)
    assert monitor.disturbance is None


@pytest.mark.parametrize("duration", [0.1, 0.5, 1.0])
def test_without_poses_the_control_leads_the_vehicle_after_its_lag(duration):
    monitor = hovering(noise=0.0)
    begin = monitor._time  # The middle of the last block.
    for k in range(round(duration / PERIOD)):
        position = monitor.predict(3.0 + k * PERIOD, (0.0, 2.0, 0.0), (2.99, (0.0, 0.0, 1.0)))
    # To within the uncertainty of the lag: twice the integral of 2 (1 - exp(-t / LAG)).
    t = 3.0 + duration - PERIOD - begin
    led = 2.0 * (0.5 * t * t - LAG * t + LAG * LAG * (1.0 - math.exp(-t / LAG)))
    assert position == pytest.approx((0.0, led, 1.0), abs=2.0 * t * LAG_ERROR)


def test_a_vehicle_whose_motion_was_not_observed_is_led_from_rest():
    monitor = ResponseMonitor()
    fly(monitor, 0.0, 1.0, lambda t: (t, 0.0, 1.0), ZERO)
    moving = monitor.predict(1.1, ZERO, (0.99, (0.99, 0.0, 1.0)))
    assert moving == pytest.approx((1.1, 0.0, 1.0), abs=0.005)
    at_rest = monitor.predict(3.0, ZERO, (2.0, (0.99, 0.0, 1.0)))
    assert at_rest == pytest.approx((0.99, 0.0, 1.0), abs=1e-9)


def test_outliers_do_not_end_the_comparison_with_the_control():
    monitor = hovering()
    random = np.random.default_rng(2)
    departed = None
    for k in range(150):
        time = 3.0 + k * PERIOD
        if k % 20 in (17, 18, 19):
            monitor.predict(time, (2.0, 0.0, 0.0), (time - PERIOD, (0.0, 0.0, 1.0)))
        elif monitor.update(time, random.normal((0.0, 0.0, 1.0), 0.0005).tolist(), (2.0, 0.0, 0.0)):
            departed = time
            break
    assert departed < 4.0


@pytest.mark.parametrize("noise", [0.0005, 0.003])
def test_a_vehicle_that_moves_otherwise_than_the_control_commands_is_believed(noise):
    """As one in a gust, or that somebody pushes."""
    monitor = hovering(noise=noise)
    pushed = fly(monitor, 3.0, 0.6, lambda t: (0.8 * t * t, 0.0, 1.0), (-2.0, 0.0, 0.0), noise)
    assert pushed is None
