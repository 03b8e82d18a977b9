"""The estimator against closed forms and scipy's Riccati equation."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.spatial.transform import Rotation
from virtual_bench import Bench

from crazyflie_model.units import GRAVITY
from crazyflie_virtual.firmware.estimator import Estimator
from crazyflie_virtual.firmware.states import Estimate

DT = 0.002


@pytest.fixture
def estimator():
    return Estimator(Estimate())


def sensors(gyro=(0.0, 0.0, 0.0), force=(0.0, 0.0, 1.0)):
    return SimpleNamespace(
        gyro_x=gyro[0],
        gyro_y=gyro[1],
        gyro_z=gyro[2],
        acc_x=force[0],
        acc_y=force[1],
        acc_z=force[2],
        asl=0.0,
    )


def move(estimator, measured):
    estimator.sample(measured)
    estimator.predict(DT)


def estimate_of(estimator):
    return estimator._estimate


def test_dead_reckoning_of_a_constant_acceleration(estimator):
    for _ in range(500):
        move(estimator, sensors(force=(0.1, -0.2, 1.3)))
    e = estimate_of(estimator)
    expected = np.array([0.1, -0.2, 0.3]) * GRAVITY
    np.testing.assert_allclose((e.vx, e.vy, e.vz), expected, rtol=1e-9)
    np.testing.assert_allclose((e.x, e.y, e.z), expected / 2.0, rtol=1e-9)
    np.testing.assert_allclose((e.ax, e.ay, e.az), expected / GRAVITY, rtol=1e-9)


@pytest.mark.parametrize("rates", [(40.0, 0.0, 0.0), (0.0, 30.0, 0.0), (10.0, -20.0, 50.0)])
def test_attitude_is_the_integral_of_the_rates(estimator, rates):
    for _ in range(500):
        move(estimator, sensors(gyro=rates))
    expected = Rotation.from_rotvec(np.radians(rates))
    error = expected.inv() * Rotation.from_quat(estimate_of(estimator).quaternion)
    assert error.magnitude() < 1e-4
    # The firmware's pitch is the other way round.
    yaw, pitch, roll = expected.as_euler("ZYX", degrees=True)
    e = estimate_of(estimator)
    assert (e.roll, e.pitch, e.yaw) == pytest.approx((roll, -pitch, yaw), abs=0.01)


def test_a_prediction_is_by_the_mean_of_the_samples_since_the_last(estimator):
    for rate in (100.0, 0.0, 20.0):
        estimator.sample(sensors(gyro=(0.0, 0.0, rate)))
        assert estimate_of(estimator).yaw == 0.0
    for _ in range(2):
        estimator.predict(0.01)
        assert estimate_of(estimator).yaw == pytest.approx(0.4, abs=1e-4)
        estimator.sample(sensors())


def test_the_first_measurements_count_in_full(estimator):
    estimator.correct_position(4.0, 5.0, 6.0, 0.01)
    estimator.correct_attitude(0.0, 0.0, math.sin(1.0), math.cos(1.0), 0.01)
    e = estimate_of(estimator)
    assert (e.x, e.y, e.z) == pytest.approx((4.0, 5.0, 6.0), abs=1e-3)
    assert e.yaw == pytest.approx(math.degrees(2.0), abs=0.01)


def test_gain_converges_to_that_of_the_riccati_equation(estimator):
    dt, deviation, noise = 0.01, 0.01, 3.7e-4
    for _ in range(2000):
        estimator.grow_variances(dt)
        before = (estimator.variance_position, estimator.variance_velocity)
        estimator.correct_position(0.0, 0.0, 0.0, deviation)
    a = np.array([[1.0, dt], [0.0, 1.0]])
    c = np.array([[1.0], [0.0]])
    # White noise of the acceleration, over one step.
    q = noise * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    p = solve_discrete_are(a.T, c, q, np.array([[deviation**2]]))
    np.testing.assert_allclose(before, np.diag(p), rtol=1e-3)


def test_velocity_follows_from_positions(estimator):
    for k in range(300):
        for _ in range(5):
            move(estimator, sensors())
        estimator.grow_variances(0.01)
        estimator.correct_position(0.01 * 0.5 * (k + 1), 0.0, 1.0, 0.01)
    e = estimate_of(estimator)
    assert (e.vx, e.vy, e.vz) == pytest.approx((0.5, 0.0, 0.0), abs=0.01)


def test_both_signs_of_a_quaternion_are_the_same_attitude(estimator):
    for sign in (1.0, -1.0, 1.0, -1.0):
        estimator.correct_attitude(0.0, 0.0, sign * math.sin(0.5), sign * math.cos(0.5), 0.1)
        assert estimate_of(estimator).yaw == pytest.approx(math.degrees(1.0), abs=0.1)


@pytest.mark.parametrize("initial_yaw", [0.0, 1.0])
def test_at_rest_the_attitude_returns_to_the_initial_one(estimator, initial_yaw):
    estimator.initial_yaw = initial_yaw
    estimator.reset()
    before = Rotation.from_euler("ZYX", [initial_yaw + 0.7, 0.4, -0.5])
    estimator.correct_attitude(*before.as_quat(), 1e-6)
    for _ in range(500):
        estimator.correct_on_ground(0.01)
    initial = Rotation.from_euler("Z", initial_yaw)
    # Along the great circle between the two quaternions, at sin(angle / 2) / 10 s.
    angle = (initial.inv() * before).magnitude()
    expected = 4.0 * math.atan(math.tan(angle / 4.0) * math.exp(-0.5))
    after = initial.inv() * Rotation.from_quat(estimate_of(estimator).quaternion)
    assert after.magnitude() == pytest.approx(expected, rel=1e-3)
    axes = [r.as_rotvec() / r.magnitude() for r in (initial.inv() * before, after)]
    np.testing.assert_allclose(*axes, atol=1e-3)


def test_reset_begins_where_it_is_told(estimator):
    move(estimator, sensors(force=(1.0, 0.0, 1.0)))
    estimator.initial_x, estimator.initial_yaw = 2.0, 1.0
    estimator.reset()
    e = estimate_of(estimator)
    assert (e.x, e.vx) == (2.0, 0.0)
    assert e.yaw == pytest.approx(math.degrees(1.0))
    assert estimator.variance_position == 100.0


def test_years_without_a_measurement(estimator):
    for _ in range(10000):
        estimator.grow_variances(100.0)
    estimator.correct_position(1.0, 0.0, 0.0, 0.01)
    e = estimate_of(estimator)
    assert e.x == pytest.approx(1.0, abs=1e-3)
    assert abs(e.vx) < 1.0


def test_the_complementary_filter_knows_no_position():
    bench = Bench(positioning="none", estimator=1)
    localization = bench.firmware.localization
    for _ in range(300):
        localization.take_position(bench.firmware.time, (2.0, 1.0, 3.0))
        bench.run(0.01)
    e = bench.firmware.estimate
    assert (e.x, e.y) == (0.0, 0.0)
    # The barometer's, with its noise: the vehicle is on the ground.
    assert abs(e.z) < 0.2
    # With the Kalman filter they count.
    bench.firmware.estimator.kind = 2
    for _ in range(300):
        localization.take_position(bench.firmware.time, (2.0, 1.0, 3.0))
        bench.run(0.01)
    assert (e.x, e.y, e.z) == pytest.approx((2.0, 1.0, 3.0), abs=0.01)
