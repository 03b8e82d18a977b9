"""The body of the vehicle."""

import numpy as np
import pytest

from crazyflie_model.angles import zyx_from_quaternion
from crazyflie_model.units import GRAVITY, HOVER_PWM
from crazyflie_virtual.body import FULL_VOLTAGE, STEP, Physics, Sensors


def fly(physics, commands, duration, voltage=FULL_VOLTAGE):
    for _ in range(round(duration / STEP)):
        physics.step(commands, voltage)


def test_stands_still_and_feels_gravity():
    physics = Physics((1.0, 2.0, 0.0), yaw=0.5)
    fly(physics, (0.0,) * 4, 0.5)
    assert physics.position == (1.0, 2.0, 0.0)
    assert physics.quaternion == pytest.approx((0.0, 0.0, np.sin(0.25), np.cos(0.25)))
    assert physics.specific_force == pytest.approx((0.0, 0.0, GRAVITY))


@pytest.mark.parametrize(("mass_error", "thrust_error"), [(0.0, 0.0), (0.05, 0.0), (0.0, -0.05)])
def test_hover_thrust_is_that_of_the_link(mass_error, thrust_error):
    physics = Physics((0.0, 0.0, 0.0), 0.0, mass_error, thrust_error)
    hover = HOVER_PWM * (1.0 + mass_error) / (1.0 + thrust_error)
    fly(physics, (0.99 * hover,) * 4, 1.0)
    assert physics.position[2] == 0.0
    assert physics.specific_force[2] == pytest.approx(GRAVITY)
    # The load goes with the third power of the speed, thrust with the second.
    assert physics.load == pytest.approx((0.99 * hover / HOVER_PWM) ** 1.5, rel=1e-3)
    fly(physics, (1.01 * hover,) * 4, 1.0)
    assert physics.position[2] > 0.02
    assert physics.specific_force[2] == pytest.approx(1.01 * GRAVITY, rel=3e-3)


def test_a_low_battery_limits_the_thrust():
    full, low = Physics(), Physics()
    fly(full, (60000.0,) * 4, 0.5, voltage=4.0)
    fly(low, (60000.0,) * 4, 0.5, voltage=3.0)
    assert full.specific_force[2] > 1.3 * GRAVITY
    assert low.specific_force[2] < 1.2 * GRAVITY


def test_a_fall_feels_like_nothing_and_ends_on_the_ground():
    physics = Physics((0.0, 0.0, 0.5))
    fly(physics, (0.0,) * 4, 0.2)
    assert physics.specific_force == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    while physics.position[2] > 0.0:
        speed = -physics.velocity[2]
        fly(physics, (0.0,) * 4, STEP)
    assert speed == pytest.approx(np.sqrt(2.0 * GRAVITY * 0.5), rel=0.02)
    assert not physics.is_overturned


def test_coming_down_on_the_back():
    physics = Physics((0.0, 0.0, 3.0))
    fly(physics, (60000.0, 60000.0, 0.0, 0.0), 0.2)
    fly(physics, (0.0,) * 4, 0.4)
    while physics.position[2] > 0.0:
        physics.step((0.0,) * 4, FULL_VOLTAGE)
    physics.is_overturned = True
    fly(physics, (60000.0,) * 4, 0.5)
    assert physics.position[2] == 0.0
    assert physics.specific_force == (0.0, 0.0, -GRAVITY)
    physics.put_upright()
    fly(physics, (60000.0,) * 4, 0.5)
    assert physics.position[2] > 0.0


def tilt(physics):
    """Return the tilt of the body, deg."""
    x, y, _, _ = physics.quaternion
    return np.degrees(np.arccos(1.0 - 2.0 * (x * x + y * y)))


def test_feet_hold_what_the_weight_on_them_can_hold():
    # Half of the weight is on the feet: they hold 0.5 m g d, rotors on one side ask for less.
    physics = Physics()
    half = 0.5 * HOVER_PWM
    fly(physics, (0.7 * half, 0.7 * half, 1.3 * half, 1.3 * half), 1.0)
    assert tilt(physics) == 0.0
    assert physics.rates == (0.0, 0.0, 0.0)


def test_rotors_on_one_side_tip_a_vehicle_that_stands_and_its_weight_brings_it_back():
    # Motors 3 and 4 are on the left. They carry 0.7 of the weight with the lever d: more than the
    # 0.3 on the feet of the right side hold.
    physics = Physics((1.0, 2.0, 0.0), yaw=0.5)
    while tilt(physics) < 10.0:
        fly(physics, (0.0, 0.0, 1.4 * HOVER_PWM, 1.4 * HOVER_PWM), STEP)
    roll, _, yaw = zyx_from_quaternion(physics.quaternion)
    assert np.degrees(roll) == pytest.approx(10.0, abs=0.5)
    assert yaw == pytest.approx(0.5)
    assert physics.position == pytest.approx((1.0, 2.0, 0.0), abs=1e-4)
    fly(physics, (0.0,) * 4, 0.5)
    assert tilt(physics) == 0.0
    assert physics.position == pytest.approx((1.0, 2.0, 0.0), abs=1e-4)
    assert not physics.is_overturned


def test_a_vehicle_that_is_tipped_too_far_lies_on_its_back():
    physics = Physics()
    fly(physics, (0.0, 0.0, 1.4 * HOVER_PWM, 1.4 * HOVER_PWM), 1.0)
    assert physics.is_overturned


def test_sensors_see_what_there_is():
    sensors = Sensors(noise=False)
    sensors.sample_inertial((1.0, -2.0, 3.0), (0.0, GRAVITY, -2.0 * GRAVITY))
    assert (sensors.gyro_x, sensors.gyro_y, sensors.gyro_z) == pytest.approx(
        np.degrees([1.0, -2.0, 3.0])
    )
    assert (sensors.acc_x, sensors.acc_y, sensors.acc_z) == pytest.approx((0.0, 1.0, -2.0))
    sensors.sample_inertial((100.0, 0.0, 0.0), (0.0, 0.0, 1000.0))
    assert (sensors.gyro_x, sensors.acc_z) == (2000.0, 24.0)


def test_noise_has_its_deviation_and_its_seed():
    def samples(seed):
        sensors = Sensors(seed=seed)
        rows = []
        for _ in range(3000):
            sensors.sample_inertial((0.0, 0.0, 0.0), (0.0, 0.0, GRAVITY))
            rows.append((sensors.gyro_x, sensors.gyro_z, sensors.acc_x, sensors.acc_z - 1.0))
        return np.array(rows)

    noise = samples(1)
    np.testing.assert_allclose(noise.std(axis=0), [0.1, 0.1, 0.002, 0.002], rtol=0.1)
    np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=0.01)
    np.testing.assert_array_equal(noise, samples(1))
    assert (noise != samples(2)).any()


def test_barometer_and_magnetometer():
    sensors = Sensors(noise=False)
    sensors.sample_slow(100.0, (0.0, 0.0, 0.0, 1.0))
    # Standard atmosphere at 100 m.
    assert sensors.pressure == pytest.approx(1001.3, abs=0.3)
    north = sensors.mag_x
    half = np.sqrt(0.5)
    sensors.sample_slow(0.0, (0.0, 0.0, half, half))
    # The nose to the left of north: north is to the right.
    assert (sensors.mag_x, sensors.mag_y) == pytest.approx((0.0, -north), abs=1e-12)
