"""A flight from takeoff to landing, by nodes of any maker."""

import numpy as np
import pytest

from crazyflie_model.units import GRAVITY
from crazyflie_reports.flight_operator import ready_operator
from crazyflie_reports.flight_record import HOVER_TOLERANCE, FlightReport

HOVER = (0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def record():
    """Fly once, and return what was recorded."""
    with ready_operator() as operator:
        # The soft gains need 10 s to settle within the tolerance.
        return operator.fly(8.0)


def test_stays_on_the_ground_until_it_is_told_to_take_off(record):
    heights = record.state.between(0.0, record.events["takeoff"])[:, 2]
    assert np.all(heights == 0.0)


def test_hovers(record):
    assert FlightReport.of(record, HOVER).hover_error_max < HOVER_TOLERANCE


def test_is_on_the_ground_with_zero_thrust_at_the_end(record):
    report = FlightReport.of(record, HOVER)
    assert report.final_height == 0.0
    assert report.final_thrust == 0.0


def test_takeoff_is_a_push_and_landing_a_ramp(record):
    events = record.events
    thrusts = record.takeoff_control.between(events["takeoff"], events["flying"])[:, 3]
    # The call takes a while to arrive, which is longer in simulated time.
    push = thrusts[np.flatnonzero(thrusts)[0] :]
    np.testing.assert_allclose(push, GRAVITY + 0.2)
    ramp = record.takeoff_control.between(events["land"], record.state.last_time)[:, 3]
    falling = ramp[ramp > 0.0]
    assert falling.size > 50
    assert np.all(np.diff(falling) < 0.0)
    assert ramp[-1] == 0.0
