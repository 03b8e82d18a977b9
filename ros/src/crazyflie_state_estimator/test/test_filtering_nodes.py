"""The estimator nodes with a Kalman filter, and changes of it in flight."""

import math

import numpy as np
import pytest
from estimator_helpers import fly, launch, moving, transform
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_state_estimator.control_response import LAG
from crazyflie_state_estimator.estimator_node import FullStateEstimatorNode
from crazyflie_utils import ServiceError


@pytest.mark.parametrize("axis", ["x", "z", "yaw"])
def test_the_kalman_filter_smooths(axis):
    rng = np.random.default_rng(5)

    def noisily(elapsed):
        position, attitude = moving(elapsed)
        return position + 0.001 * rng.normal(size=3), attitude + 0.005 * rng.normal(size=3)

    def deviation(filter_type):
        process = launch(FullStateEstimatorNode, x_dim=12, **{"filter/type": filter_type})
        fly(process, noisily, 3.0)
        states = [message.state for message in process.published("/state")]
        assert len(states) == 299
        return np.std([getattr(state, f"{axis}_dot") for state in states[100:]])

    assert 3.0 * deviation("kalman") < deviation("finite_difference")


def test_the_kalman_filter_begins_with_the_second_transform():
    process = launch(**{"filter/type": "kalman"})
    fly(process, moving, 0.02)
    (message,) = process.published("/state")
    assert message.state.x_dot == pytest.approx(1.0, abs=0.01)
    assert message.state.yaw == pytest.approx(3.01)


def thrown(process, thrust):
    """Hover for a second and then accelerate upwards; return the errors of z_dot while doing so.

    The motors follow the control with the usual lag.
    """
    acceleration, sent, height, speed, errors = 0.0, 0.0, 1.0, 0.0, []
    for k in range(120):
        process.publish("/tf", TFMessage([transform(process, (0.0, 0.0, height))]))
        process.advance(0.01)
        if k >= 100:
            errors.append(abs(process.published("/state")[-1].state.z_dot - speed))
            sent = 5.0
        control = Control(thrust=thrust + sent)
        if "/control" in process.transport.subscribers:
            process.publish("/control", ControlStamped(control=control))
        acceleration += (1.0 - math.exp(-0.01 / LAG)) * (sent - acceleration)
        height += 0.01 * speed + 0.5 * 0.01**2 * acceleration
        speed += 0.01 * acceleration
    return errors


def test_the_kalman_filter_uses_the_control_it_is_given():
    without = thrown(launch(**{"filter/type": "kalman"}), 9.81)
    with_control = thrown(launch(**{"filter/type": "kalman", "topics/control": "/control"}), 9.81)
    assert max(without) > 0.05
    assert max(with_control) < 0.006


def test_controls_that_are_not_finite_are_ignored():
    process = launch(**{"filter/type": "kalman", "topics/control": "/control"})
    errors = thrown(process, math.nan)
    assert max(errors) < 1.0
    (warning,) = process.logged("warn")
    assert "/control" in warning


def test_the_kalman_filter_restarts_when_time_is_reset():
    process = launch(**{"filter/type": "kalman", "topics/control": "/control"})
    thrown(process, 9.81)
    process.clock.set(1.0)
    before = len(process.published("/state"))
    fly(process, moving, 0.02)
    (message,) = process.published("/state")[before:]
    assert message.state.x_dot == pytest.approx(1.0, abs=0.01)


# Changes in flight.


def test_a_change_of_the_filter_keeps_what_it_knows():
    changed, unchanged = (launch(**{"filter/type": "kalman"}) for _ in range(2))
    for process in (changed, unchanged):
        fly(process, moving, 1.0)
    changed.reconfigure(
        "/state_estimator", **{"filter/position_noise": 0.02, "filter/acceleration_walk": 0.5}
    )
    for process in (changed, unchanged):
        fly(process, lambda elapsed: moving(1.0 + elapsed), 0.05)
        speeds = [message.state.x_dot for message in process.published("/state")[-5:]]
        assert speeds == pytest.approx([1.0] * 5, abs=1e-6)


def test_a_changed_filter_smooths_more():
    def jump(**changes):
        process = launch(**{"filter/type": "kalman"})
        fly(process, moving, 1.0)
        process.reconfigure("/state_estimator", **changes)
        process.publish("/tf", TFMessage([transform(process, (2.02, -2.0, 0.5))]))
        process.advance(0.01)
        return process.published("/state")[-1].state.x_dot - 1.0

    assert 0.0 < jump(**{"filter/position_noise": 0.1}) < 0.5 * jump()


@pytest.mark.parametrize(("changes", "walk"), [({}, 3.0), ({"topics/control": "/control"}, 1.0)])
def test_the_walk_that_is_offered_depends_on_the_control(changes, walk):
    process = launch(**{"filter/type": "kalman"}, **changes)
    response = process.reconfigure("/state_estimator", **{"filter/angle_noise": 0.01})
    doubles = {parameter.name: parameter.value for parameter in response.config.doubles}
    assert doubles["filter/acceleration_walk"] == walk


@pytest.mark.parametrize(
    ("name", "value"), [("filter/position_noise", 0.0), ("filter/type", "finite_difference")]
)
def test_bad_changes_are_refused(name, value):
    process = launch(**{"filter/type": "kalman"})
    with pytest.raises(ServiceError, match=name):
        process.reconfigure("/state_estimator", **{name: value})
