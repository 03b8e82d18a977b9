"""The filter of position, velocity and disturbance, and what it predicts from the control."""

import math

import numpy as np
import pytest

from crazyflie_state_estimator.control_response import (
    LAG,
    LAG_ERROR,
    MAX_GAP,
    MIN_NOISE,
    ResponseMonitor,
)

STILL = (0.0, 0.0, 0.0)
PERIOD = 0.01


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
    assert fly(monitor, 0.0, duration, lambda _: (0.0, 0.0, 1.0), STILL, noise) is None
    return monitor


def test_what_the_poses_show_beside_the_control_is_the_disturbance():
    monitor = ResponseMonitor()
    # The vehicle sinks by 0.3 m/s^2 although 0.5 m/s^2 upwards are commanded.
    fly(monitor, 10.0, 2.0, lambda t: (0.0, 0.1 * t * t, -0.15 * t * t), (0.0, 0.0, 0.5))
    assert monitor.disturbance == pytest.approx((0.0, 0.2, -0.8), abs=0.01)


def test_a_disturbance_is_not_known_at_first_and_after_a_gap():
    monitor = ResponseMonitor()
    assert monitor.disturbance is None
    fly(monitor, 0.0, 0.1, lambda _: STILL, STILL)
    assert monitor.disturbance is None
    fly(monitor, 0.1, 1.0, lambda _: STILL, STILL)
    assert monitor.disturbance == pytest.approx(STILL, abs=1e-6)
    monitor.update(1.09 + MAX_GAP, STILL, STILL)
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
    fly(monitor, 0.0, 1.0, lambda t: (t, 0.0, 1.0), STILL)
    moving = monitor.predict(1.1, STILL, (0.99, (0.99, 0.0, 1.0)))
    assert moving == pytest.approx((1.1, 0.0, 1.0), abs=0.005)
    at_rest = monitor.predict(3.0, STILL, (2.0, (0.99, 0.0, 1.0)))
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


def test_the_departure_is_where_control_and_disturbance_have_led_the_vehicle():
    monitor = ResponseMonitor()
    wind = (-1.0, 0.0, 0.0)
    fly(monitor, 0.0, 4.0, lambda _: (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.0005)
    assert monitor.disturbance == pytest.approx(wind, abs=0.1)
    departure = None
    for k in range(100):
        departure = monitor.update(4.0 + k * PERIOD, (0.0, 0.0, 1.0), (0.0, 2.0, 0.0))
        if departure is not None:
            break
    t = k * PERIOD
    x, y, z = departure.position
    assert -0.5 * t * t < x < 0.0 < y < t * t
    assert z == pytest.approx(1.0, abs=0.02)
    x_dot, y_dot, _ = departure.velocity
    assert (x_dot < -0.4 * t, y_dot > 0.8 * t) == (True, True)


@pytest.mark.parametrize("noise", [0.0005, 0.003])
def test_a_vehicle_that_moves_otherwise_than_the_control_commands_is_believed(noise):
    """As one in a gust, or that somebody pushes."""
    monitor = hovering(noise=noise)
    pushed = fly(monitor, 3.0, 0.6, lambda t: (0.8 * t * t, 0.0, 1.0), (-2.0, 0.0, 0.0), noise)
    assert pushed is None


@pytest.mark.parametrize(("period", "blocks"), [(0.02, 2), (0.01, 3), (0.005, 3)])
def test_a_block_lasts_50_ms_and_has_four_poses(period, blocks):
    """The noise is averaged once in a block."""
    monitor = ResponseMonitor()
    before, changes = monitor._noise, 0
    for k in range(round(0.17 / period) + 1):
        monitor.update(10.0 + k * period, STILL, STILL)
        changes += monitor._noise != before
        before = monitor._noise
    assert changes == blocks


def test_the_noise_is_that_about_a_straight_line_and_not_less_than_a_tenth_of_a_millimetre():
    monitor = ResponseMonitor()
    fly(monitor, 0.0, 60.0, lambda t: (0.5 * t, -t, 0.0), STILL, noise=0.004)
    assert monitor._noise == pytest.approx(0.004, rel=0.15)
    fly(monitor, 60.0, 60.0, lambda t: (0.5 * t, -t, 0.0), STILL)
    assert monitor._noise == MIN_NOISE
