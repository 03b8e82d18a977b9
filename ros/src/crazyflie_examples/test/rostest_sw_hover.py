"""A whole flight of the software example, from takeoff to landing."""

import numpy as np
import pytest
import rospy

from crazyflie_model.units import GRAVITY
from crazyflie_reports.flight_operator import FlightError, ready_operator
from crazyflie_reports.flight_record import FlightReport

HOVER = (0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def flight():
    """Fly once; every test looks at the record and at how calls were refused."""
    with ready_operator() as operator:
        refusals = [refusal(operator.land)]
        operator.takeoff()
        refusals.append(refusal(operator.takeoff))
        operator.hover(rospy.get_param("/hover_duration", 6.0))
        operator.land()
        refusals.append(refusal(operator.land))
        return operator.finish(), refusals


@pytest.fixture
def record(flight):
    """Return what was recorded."""
    return flight[0]


def refusal(call):
    """Return why a call was refused."""
    with pytest.raises(FlightError) as error:
        call()
    return str(error.value)


def test_is_a_good_flight(record):
    assert FlightReport.of(record, HOVER).complaints() == []


def test_calls_out_of_place_are_refused(flight):
    land_on_ground, takeoff_in_flight, land_again = flight[1]
    assert "ground" in land_on_ground
    assert "in flight; land first" in takeoff_in_flight
    assert "ground" in land_again


def test_topics_speak_in_order(record):
    # Each topic has a socket of its own: stamps tell the order, the order of arrival does not.
    takes_off = record.toggles[0]
    controls, references = record.takeoff_control.times, record.reference.times
    thrusts = record.takeoff_control.column("thrust")[: controls.size]
    burst = controls[(thrusts > 0.0) & (controls < takes_off)]
    ramp = controls[(thrusts > 0.0) & (controls > takes_off)]
    hover, descent = references[references < takes_off], references[references > takes_off]
    assert burst[-1] <= hover[0]
    assert hover[-1] < takes_off < descent[0]
    assert descent[-1] <= ramp[0]
    assert controls[-1] > ramp[-1]


def test_no_zero_thrust_from_takeoff_to_landing(record):
    events = record.events
    thrusts = record.takeoff_control.between(events["takeoff"], events["flying"])[:, 3]
    # Zero thrust is repeated until the call has arrived, which takes long for a fast clock.
    thrusts = thrusts[np.flatnonzero(thrusts)[0] :]
    assert thrusts.size > 50
    np.testing.assert_allclose(thrusts, GRAVITY + 0.2)
    assert record.takeoff_control.between(events["flying"] + 0.2, events["land"]).size == 0


def test_thrust_ramps_down_after_the_descent(record):
    thrusts = record.takeoff_control.between(record.events["land"], record.state.last_time)[:, 3]
    ramp = thrusts[thrusts > 0.0]
    assert ramp.size > 50
    assert np.all(np.diff(ramp) < 0.0)
    assert ramp[0] == pytest.approx(GRAVITY, abs=0.2)
    assert ramp[-1] == pytest.approx(GRAVITY - 5.0, abs=0.2)
    assert thrusts[-1] == 0.0


def test_lands_by_reference(record):
    heights = record.reference.between(record.events["land"], record.events["landed"])[:, 2]
    assert heights.size > 50
    assert np.all(np.diff(heights) <= 0.0)
