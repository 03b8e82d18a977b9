"""Every controller flies every model with every filter of the estimator."""

import itertools

import fleet
import numpy as np
import pytest
import rospy

from crazyflie_reports.flight_record import FlightReport

HOVER = (0.0, 0.0, 1.0)
CONTROLLERS = {
    "lift": ["crazyflie_msgs/PositionVelocityStateStamped", "/state"],
    "position_velocity_yaw": ["crazyflie_msgs/PositionVelocityYawStateStamped", "/state"],
    "full_state": ["crazyflie_msgs/FullStateStamped", "/state/full_state"],
}
FILTERS = ("finite_difference", "kalman")
PAIRS = list(itertools.product(CONTROLLERS, FILTERS))
NAMES = ["_".join(pair) for pair in PAIRS]


@pytest.fixture(scope="module")
def records():
    """Fly all of them at once."""
    return fleet.fly(NAMES, hover=6.0)


@pytest.mark.parametrize("name", NAMES)
def test_is_a_good_flight(records, name):
    report = FlightReport.of(records[name], HOVER)
    print(report.table())
    assert report.complaints() == []


@pytest.mark.parametrize("name", NAMES)
def test_started_beside_the_hover_point(records, name):
    np.testing.assert_allclose(records[name].state.values[0, :3], [0.05, -0.05, 0.0], atol=2e-3)


@pytest.mark.parametrize(("controller", "estimator_filter"), PAIRS)
def test_is_the_combination_of_its_name(records, controller, estimator_filter):
    vehicle = f"/{controller}_{estimator_filter}"
    reference_type, state = CONTROLLERS[controller]
    types = dict(rospy.get_published_topics(vehicle))
    assert types[vehicle + "/" + rospy.get_param(f"{vehicle}/lqr_controller/topics/reference")] == (
        reference_type
    )
    assert "/" + rospy.get_param(f"{vehicle}/lqr_controller/topics/state") == state
    estimators = ["state_estimator", *["full_state_estimator"] * (controller == "full_state")]
    for estimator in estimators:
        assert rospy.get_param(f"{vehicle}/{estimator}/filter/type") == estimator_filter
