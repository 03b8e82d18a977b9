"""A hover of the full vehicle in closed loop, as the workspace's nodes would fly it.

At 100 Hz: position from a pose with noise, velocity from its finite difference, linear
feedback with an integrator of the position error, limits on tilt and thrust.
"""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from crazyflie_model.angles import rotate_by_yaw, rpy_from_quaternion
from crazyflie_model.stabilized_quadrotor import StabilizedQuadrotor
from crazyflie_model.units import GRAVITY
from crazyflie_simulator.motion_capture import MotionCapture
from crazyflie_simulator.vehicle import Vehicle
from crazyflie_simulator.wind import Wind

PERIOD = 0.01
GOAL = np.array([0.0, 0.0, 1.0])
START = np.array([0.1, -0.1, 0.0])
MAX_TILT = 0.2618


def lqr(r):
    """Return the gain K of u = u_ref + K (x - x_ref) for the hover and weights diag(r)^2 of u."""
    a, b = np.zeros((7, 7)), np.zeros((7, 4))
    a[:3, 3:6] = np.eye(3)
    b[3, 1], b[4, 0], b[5, 3], b[6, 2] = GRAVITY, -GRAVITY, 1.0, 1.0
    q = np.diag([1.0, 1.0, 2.0, 1.0, 1.0, 2.0, 10.0]) ** 2
    r = np.diag(r) ** 2
    return -np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q, r))


def gains(tilt, yaw, lift):
    """Return a gain K of gains on position and velocity, yaw, height and climb."""
    k = np.zeros((4, 7))
    k[0, [1, 4]] = tilt
    k[1, [0, 3]] = np.negative(tilt)
    k[2, 6] = -yaw
    k[3, [2, 5]] = np.negative(lift)
    return k


# For each: K, gains of the integrator (on x for pitch, y for roll, z for
# thrust), and its limits.
SOFT = gains((0.25, 1.0), 3.5, (1.5, 1.0)), (-0.05, 0.05, -0.5), (1.0, 1.0, 6.0)
LQR = lqr([2.0, 2.0, 3.0, 1.0 / 3.0]), (-0.1, 0.1, -4.0), (0.5, 0.5, 0.7)
STIFF = lqr([0.1] * 4), (-0.5, 0.5, -10.0), (0.5, 0.5, 0.5)


def errors(controller, duration, **options):
    """Return the distance from the goal, 100 a second, after a take-off from beside it."""
    k, integrator, limits = controller
    vehicle = Vehicle(StabilizedQuadrotor(**options), START, 0.0)
    motion_capture = MotionCapture(position_noise=1e-4, attitude_noise=1e-3)
    integral, last, distances = np.zeros(3), START, []
    for moment in np.arange(0.0, duration, PERIOD):
        vehicle.advance_to(moment)
        motion_capture.measure(moment, *vehicle.pose)
        ((_, position, quaternion),) = motion_capture.arrivals(moment)
        position = np.array(position)
        yaw = rpy_from_quaternion(*quaternion)[2]
        e = np.array([*(position - GOAL), *((position - last) / PERIOD), yaw])
        last = position
        e[:2], e[3:5] = rotate_by_yaw(*e[:2], -yaw), rotate_by_yaw(*e[3:5], -yaw)
        integral = np.clip(integral + e[:3] * PERIOD, np.negative(limits), limits)
        u = [0.0, 0.0, 0.0, GRAVITY] + k @ e
        u[[1, 0, 3]] += np.multiply(integrator, integral)
        u[:2] = np.clip(u[:2], -MAX_TILT, MAX_TILT)
        u[3] = np.clip(u[3], 4.0, 16.0)
        vehicle.command(u)
        distances.append(np.linalg.norm(vehicle.state[:3] - GOAL))
    return np.array(distances)


@pytest.mark.parametrize("controller", [SOFT, LQR], ids=["soft", "lqr"])
@pytest.mark.parametrize("mass_error", [-0.1, 0.1])
@pytest.mark.parametrize("thrust_error", [-0.1, 0.1])
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
