"""A hover of the full vehicle in closed loop, as the workspace's nodes would fly it.

At 100 Hz: position from a pose with noise, velocity from its finite difference, linear
feedback with an integrator of the position error, limits on tilt and thrust.
"""

from pathlib import Path

import numpy as np
import pytest
from rospkg import RosPack

from crazyflie_lqr.design import Weights, design_gains
from crazyflie_lqr.gain_file import load_matrix
from crazyflie_lqr.linear_feedback import IntegralStateFeedback
from crazyflie_lqr.models import near_hover
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_model.stabilized_quadrotor import StabilizedQuadrotor
from crazyflie_model.units import GRAVITY
from crazyflie_simulator.vehicle import MotionCapture, SimulatedVehicle
from crazyflie_simulator.wind import Wind
from crazyflie_state_estimator.motion import FiniteDifference, MotionEstimator

PERIOD = 0.01
GOAL = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
START = np.array([0.1, -0.1, 0.0])
HOVER = np.array([0.0, 0.0, 0.0, GRAVITY])


def lqr(r):
    """Return the gain K for the hover and weights diag(r)^2 of u."""
    q = np.diag([1.0, 1.0, 2.0, 1.0, 1.0, 2.0, 10.0]) ** 2
    return design_gains(near_hover(), Weights(q, np.diag(r) ** 2, np.zeros((7, 4)))).K


# For each: K, gains of the integrator, and its limits.
SOFT = (
    load_matrix(str(Path(RosPack().get_path("crazyflie_lqr"), "config", "K_soft.txt")), 4, 7),
    (-0.05, 0.05, -0.5),
    (1.0, 1.0, 6.0),
)
LQR = lqr([2.0, 2.0, 3.0, 1.0 / 3.0]), (-0.1, 0.1, -4.0), (0.5, 0.5, 0.7)
STIFF = lqr([0.1] * 4), (-0.5, 0.5, -10.0), (0.5, 0.5, 0.5)


def errors(controller, duration, **options):
    """Return the distance from the goal, 100 a second, after a takeoff next to it."""
    gains, integrator, limits = controller
    feedback = IntegralStateFeedback(gains, HOVER, 6, integrator, limits)
    estimator = MotionEstimator(FiniteDifference(), FiniteDifference())
    vehicle = SimulatedVehicle(StabilizedQuadrotor(**options), START, 0.0)
    motion_capture = MotionCapture(position_noise=1e-4, attitude_noise=1e-3)
    distances = []
    for count in range(round(duration / PERIOD)):
        moment = count * PERIOD
        vehicle.advance_to(moment)
        motion_capture.measure(moment, *vehicle.pose)
        ((_, position, quaternion),) = motion_capture.arrivals(moment)
        attitude = rpy_from_quaternion(*quaternion)
        motion = estimator.update(round(moment * 1e9), position, attitude)
        if motion is not None:
            state = np.array([*motion.position, *motion.velocity, motion.attitude[2]])
            vehicle.command(feedback.control(state, GOAL, moment))
        distances.append(np.linalg.norm(vehicle.state[:3] - GOAL[:3]))
    return np.array(distances)


@pytest.mark.parametrize("controller", [SOFT, LQR], ids=["soft", "lqr"])
@pytest.mark.parametrize(
    ("mass_error", "thrust_error"),
    [
        # Heavy and weak, light and strong; in the others one makes up for the other.
        (0.1, -0.1),
        (-0.1, 0.1),
        pytest.param(0.1, 0.1, marks=pytest.mark.long),
        pytest.param(-0.1, -0.1, marks=pytest.mark.long),
    ],
)
def test_hover_holds_with_mass_and_thrust_off_by_a_tenth(controller, mass_error, thrust_error):
    distances = errors(controller, 25.0, mass_error=mass_error, thrust_error=thrust_error)
    assert distances[2000:].max() < 0.02


def test_hover_holds_in_a_steady_wind():
    distances = errors(LQR, 40.0, wind=Wind((0.5, -0.5, 0.0)).velocity)
    assert distances[3000:].max() < 0.02


def test_without_the_integrator_it_does_not():
    without = (LQR[0], (0.0, 0.0, 0.0), LQR[2])
    assert errors(without, 10.0, mass_error=0.1)[500:].min() > 0.02


def test_gains_for_an_attitude_that_follows_at_once_are_too_stiff_for_it():
    assert errors(STIFF, 10.0)[500:].max() > 0.02
