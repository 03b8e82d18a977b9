"""The model against closed forms, its gains, and its nodes in one fake process."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from crazyflie_lqr.gain_file import load_matrix
from crazyflie_model.dynamics import STEP
from crazyflie_model.units import GRAVITY
from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils.testing import FakeProcess
from yaw_lag.dynamics import YawLag
from yaw_lag.gains import TIME_CONSTANT, design, linear_model
from yaw_lag.yaw_lag_simulator_node import YawLagSimulatorNode
from yaw_lag.yaw_rate_state_estimator_node import YawRateStateEstimatorNode
from yaw_lag.yaw_rate_state_lqr_node import YawRateStateLqrNode

K_FILE = Path(__file__).parents[1] / "config" / "K.txt"
HOVER = [0.0, 0.0, 0.0, GRAVITY]


def fly(x, control, duration):
    """Return the state after ``duration`` (s) under a feedback law."""
    dynamics = YawLag(TIME_CONSTANT)
    for count in range(round(duration / STEP)):
        x = dynamics.step(count, x, control(x))
    return x


def test_yaw_rate_follows_with_a_lag():
    commanded, t, T = 0.8, 0.4, TIME_CONSTANT
    x = fly(YawLag(T).initial_state((0, 0, 1)), lambda x: [0.0, 0.0, commanded, GRAVITY], t)
    assert x[7] == pytest.approx(commanded * (1.0 - math.exp(-t / T)))
    assert x[6] == pytest.approx(commanded * (t - T * (1.0 - math.exp(-t / T))))


def test_linear_model_is_the_derivative_of_the_dynamics():
    model, dynamics = linear_model(), YawLag(TIME_CONSTANT)
    h = 1e-6
    at_hover = dynamics.derivative(0.0, np.zeros(8), HOVER)
    for matrix, steps in ((model.A, np.eye(8)), (model.B, np.eye(4))):
        for column, step in zip(matrix.T, h * steps, strict=True):
            x, u = (step, np.zeros(4)) if len(step) == 8 else (np.zeros(8), step)
            slope = (dynamics.derivative(0.0, x, HOVER + u) - at_hover) / h
            np.testing.assert_allclose(slope, column, atol=1e-5)


def test_shipped_gains_are_those_of_the_design():
    np.testing.assert_allclose(load_matrix(str(K_FILE), 4, 8), design().K, atol=1e-9)


def test_yaw_loop_flies_as_it_was_designed():
    K, model = design().K, linear_model()
    start = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    goal = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    flown = fly(start, lambda x: (HOVER + K @ (np.array(x) - goal)).tolist(), 1.0)
    expected = goal + expm(model.A + model.B @ K) @ (start - goal)
    # The control is held for a step of 1 ms.
    np.testing.assert_allclose(flown, expected, atol=2e-3)


def test_nodes_fly_together():
    process = FakeProcess()
    frames = {"frames/fixed": "world", "frames/robot": "crazyflie", "time_step": 0.01}
    simulator = {**frames, "topics/control": "/control", "init/x": 0.5, "init/y": 0, "init/z": 0.5}
    assert process.launch(YawLagSimulatorNode(), "/simulator", simulator)
    estimator = {**frames, "x_dim": 8, "topics/state": "/yaw_rate_state"}
    assert process.launch(YawRateStateEstimatorNode(), "/estimator", estimator)
    u_ref = K_FILE.with_name("u_ref.txt")
    controller = {
        "x_dim": 8,
        "u_dim": 4,
        "K_file": str(K_FILE),
        "u_ref_file": str(u_ref),
        "topics/reference": "/ref",
        "topics/state": "/yaw_rate_state",
        "topics/control": "/control",
    }
    assert process.launch(YawRateStateLqrNode(), "/lqr_controller", controller)
    reference = PositionVelocityState(x=0.0, y=0.0, z=1.0)
    process.publish("/ref", PositionVelocityStateStamped(state=reference))
    process.advance(6.0)
    state = process.published("/yaw_rate_state")[-1].state
    assert (state.x, state.y, state.z) == pytest.approx((0.0, 0.0, 1.0), abs=0.01)
