"""The body: motion, battery, ranging sensors, quaternions."""

import dataclasses
import math

import numpy as np
import pytest
from cflib.utils.encoding import compress_quaternion as reference
from hypothesis import assume, given
from hypothesis import strategies as st
from virtual_bench import Bench, command, generic

from crazyflie_model.aerodynamics import Air
from crazyflie_model.angles import zyx_from_quaternion
from crazyflie_model.quadrotor import CRAZYFLIE, TYPES
from crazyflie_model.units import GRAVITY, HOVER_PWM
from crazyflie_utils import ParameterError
from crazyflie_virtual.body import (
    FULL_VOLTAGE,
    LOW_CHARGE,
    MAX_RAW,
    NOTHING,
    STEP,
    Battery,
    Physics,
    RangingSensors,
    Sensors,
    open_circuit_voltage,
)
from crazyflie_virtual.firmware.supervisor import LOW, ON_BATTERY, PowerMonitor
from crazyflie_virtual.log import log_variables
from crazyflie_virtual.quaternions import compress_quaternion, decompress_quaternion
from crazyflie_virtual.settings import VehicleSettings
from crazyflie_virtual.vehicle import VirtualVehicle


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


def drained(battery, duration, load, dt=0.1):
    for _ in range(round(duration / dt)):
        battery.step(dt, load)
    return battery


def test_hover_lasts_as_long_as_the_data_sheet_says():
    assert 0.0 < drained(Battery(), 6.0 * 60.0, load=1.0).charge < 0.15


def test_idling_takes_hours():
    assert drained(Battery(), 600.0, load=0.0).charge > 0.9


def test_charge_that_is_taken_is_current_times_time():
    battery = drained(Battery(), 60.0, load=1.0)
    assert 1.0 - battery.charge == pytest.approx(battery.current * 60.0 / 900.0)


def test_voltage_sags_under_load_and_comes_back():
    battery = Battery(0.5)
    idle = drained(battery, 0.1, load=0.0).voltage
    flying = drained(battery, 0.1, load=1.0).voltage
    assert 0.2 < idle - flying < 0.4
    assert drained(battery, 0.1, load=0.0).voltage == pytest.approx(idle, abs=0.01)


def test_open_circuit_voltage_is_monotonic():
    voltages = [open_circuit_voltage(i / 100.0) for i in range(101)]
    assert voltages == sorted(voltages)
    assert (voltages[0], voltages[-1]) == (3.0, 4.2)


def test_low_charge_is_low_in_flight_and_not_critical():
    voltage = drained(Battery(LOW_CHARGE), 0.1, load=1.0).voltage
    assert 3.0 < voltage < 3.2


def test_battery_never_has_less_than_nothing():
    battery = drained(Battery(0.0), 10.0, load=30.0)
    assert battery.charge == 0.0
    assert battery.voltage == 0.0


def test_monitor_says_low_after_five_seconds():
    monitor = PowerMonitor()
    for k in range(100):
        monitor.update(0.1 * k, 3.1 if k >= 20 else 4.0)
        assert monitor.state == (LOW if k > 69 else ON_BATTERY)
    monitor.update(10.0, 3.3)
    assert monitor.state == ON_BATTERY


@pytest.mark.parametrize(
    ("voltage", "level"), [(2.9, 0), (3.5, 10), (3.8, 20), (3.93, 60), (4.2, 90)]
)
def test_level_is_guessed_from_the_voltage(voltage, level):
    monitor = PowerMonitor()
    monitor.update(0.0, voltage)
    assert monitor.level == level


SIDES = ("front", "back", "left", "right", "up")


class At:
    """A body at a height, m, with an attitude."""

    world = None

    def __init__(self, height, quaternion=(0.0, 0.0, 0.0, 1.0)):
        self.position = (0.0, 0.0, height)
        self.quaternion = quaternion


def test_on_the_ground_and_in_flight():
    bench = Bench(multiranger=True)
    values = {v.name: v.read for v in log_variables() if v.group == "range"}
    assert values["zrange"](bench.firmware) == 0
    bench.take_off(1.0)
    assert values["zrange"](bench.firmware) == pytest.approx(1000.0 * bench.height, abs=5)
    assert {values[side](bench.firmware) for side in SIDES} == {NOTHING}


def test_the_ground_is_beside_a_vehicle_that_is_tilted():
    half = math.radians(60.0) / 2.0
    # Nose down.
    tilted = RangingSensors(At(1.0, (0.0, math.sin(half), 0.0, math.cos(half))), True, True)
    assert tilted.distance("front") == round(1000.0 / math.sin(math.radians(60.0)))
    assert tilted.distance("zrange") == 2000
    assert {tilted.distance(side) for side in ("back", "up", "left", "right")} == {NOTHING}


def test_reach():
    """The sensor down is not filtered: its readings end where the sensor does."""
    for height, reading in ((3.99, 3990), (5.5, 5500), (9.0, MAX_RAW)):
        assert RangingSensors(At(height), True, True).distance("zrange") == reading
    above = (0.0, 1.0, 0.0, 0.0)
    for height, reading in ((3.99, 3990), (4.01, NOTHING)):
        assert RangingSensors(At(height, above), True, True).distance("up") == reading


def test_without_decks():
    without = RangingSensors(Physics(), False, False)
    assert [without.distance(side) for side in (*SIDES, "zrange")] == [0] * 6


WORLD = """\
floor: {size: [4, 4]}
objects:
  - {type: box, name: box, centre: [1.5, 0, 1], size: [1, 1, 1]}
"""


def test_what_is_in_a_world(tmp_path):
    file = tmp_path / "room.yaml"
    file.write_text(WORLD)
    bench = Bench(multiranger=True, world=str(file))
    bench.take_off(1.0)
    ranging = bench.firmware.ranging
    x, _, height = bench.physics.position
    assert ranging.distance("front") == pytest.approx(1000.0 * (1.0 - x), abs=20)
    assert ranging.distance("zrange") == pytest.approx(1000.0 * height, abs=20)
    assert {ranging.distance(side) for side in ("back", "left", "right", "up")} == {NOTHING}


def test_a_bad_world_is_named(tmp_path):
    file = tmp_path / "room.yaml"
    file.write_text(WORLD.replace("type: box", "type: cone"))
    with pytest.raises(ParameterError, match=r"room\.yaml:3: .*'cone'"):
        Bench(multiranger=True, world=str(file))


COMPONENTS = st.tuples(*[st.floats(-1.0, 1.0)] * 4)


def unit(components):
    vector = np.array(components)
    assume(np.linalg.norm(vector) > 0.1)
    return tuple((vector / np.linalg.norm(vector)).tolist())


@given(COMPONENTS)
def test_compression_is_the_clients(components):
    quaternion = unit(components)
    assert compress_quaternion(quaternion) == reference(quaternion)


@given(COMPONENTS)
def test_compressed_quaternions_come_back(components):
    quaternion = unit(components)
    returned = np.array(decompress_quaternion(compress_quaternion(quaternion)))
    # The same rotation, perhaps with the other sign; 9 bits of magnitude.
    assert abs(np.dot(returned, quaternion)) > 1.0 - 1e-5


def test_a_model_hovers_where_its_thrust_curve_carries_its_mass():
    model = dataclasses.replace(TYPES["cf21_markers"], mass=0.045)
    fraction = 0.78877  # The root of 4 (0.0677 f + 0.0915 f^2) = 0.045 g.
    for factor, lifts in ((0.99, False), (1.01, True)):
        physics = Physics(model=model)
        fly(physics, (factor * fraction * 65535.0,) * 4, 1.0, voltage=4.2)
        assert (physics.position[2] > 0.0) is lifts


def test_a_virtual_vehicle_of_a_model_file_flies_it(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("type: cf21_markers\nmass: 0.045\n")
    vehicle = VirtualVehicle(VehicleSettings.from_mapping({"model": str(path), "observer/port": 0}))
    fly(vehicle.physics, (0.99 * 0.78877 * 65535.0,) * 4, 1.0, voltage=4.2)
    assert vehicle.physics.position[2] == 0.0
    with pytest.raises(ParameterError, match="mass .* is 33"):
        path.write_text("mass: 33\n")
        VehicleSettings.from_mapping({"model": str(path)})


def lagging(**figures):
    """Return the body of a vehicle at 2 m, which hovers, of a model with lags."""
    figures = {"roll_lag": 0.1, "pitch_lag": 0.05, "yaw_lag": 0.2, **figures}
    physics = Physics((0.0, 0.0, 2.0), yaw=1.0, model=dataclasses.replace(CRAZYFLIE, **figures))
    fly(physics, (HOVER_PWM,) * 4, 2.0)
    return physics


def attitude(physics):
    return zyx_from_quaternion(physics.quaternion)


def test_a_model_with_lags_follows_the_attitude_that_is_asked_for():
    share = 1.0 - math.exp(-1.0)
    for k, lag in ((0, 0.1), (1, 0.05)):
        physics = lagging()
        physics.desired = (0.1, 0.0, 0.0) if k == 0 else (0.0, 0.1, 0.0)
        fly(physics, (HOVER_PWM,) * 4, lag)
        assert attitude(physics)[k] == pytest.approx(0.1 * share, rel=1e-3)
        # The measurement of a gyroscope.
        assert physics.rates[k] == pytest.approx(0.1 * (1.0 - share) / lag, rel=0.03)
    physics = lagging()
    physics.desired = (0.0, 0.0, 0.5)
    fly(physics, (HOVER_PWM,) * 4, 0.2)
    assert physics.rates[2] == pytest.approx(0.5 * share, rel=0.02)


def test_it_is_late_by_its_delay_and_drifts_by_its_trims():
    physics = lagging(delay=0.03)
    physics.desired = (0.1, 0.0, 0.0)
    fly(physics, (HOVER_PWM,) * 4, 0.03)
    assert attitude(physics)[0] == 0.0
    fly(physics, (HOVER_PWM,) * 4, STEP)
    assert attitude(physics)[0] > 0.0
    physics = lagging(roll_trim=0.02, pitch_trim=-0.03)
    assert attitude(physics)[:2] == pytest.approx((-0.02, 0.03), abs=1e-6)


@pytest.mark.parametrize("controller", [1, 2])
def test_a_virtual_vehicle_with_lags_goes_where_it_is_sent(tmp_path, controller):
    path = tmp_path / "mine.yaml"
    path.write_text("type: cf21\nlag: {roll: 0.08, pitch: 0.08, yaw: 0.1}\ndelay: 0.01\n")
    bench = Bench(model=str(path), observer_port=0, init_yaw=1.0)
    bench.firmware.stabilizer.controller = controller
    bench.take_off()
    bench.stream(generic(7, "ffff", 0.5, -0.3, 1.0, 1.5 * 57.3), 6.0)
    assert bench.physics.position == pytest.approx((0.5, -0.3, 1.0), abs=0.1)
    assert attitude(bench.physics)[2] == pytest.approx(1.5, abs=0.1)


def thrust(benches, duration=3.0):
    """Return the mean thrust of the first one while all advance together, PWM."""
    thrusts = []
    for _ in range(round(duration / 0.02)):
        for bench in benches:
            bench.run(0.02)
        thrusts.append(benches[0].firmware.stabilizer.thrust)
    return sum(thrusts) / len(thrusts)


def test_a_vehicle_needs_more_thrust_in_the_downwash_of_another():
    lower, upper = Bench(), Bench(init_x=1.0)
    air = lower.physics.air = upper.physics.air = Air()
    lower.take_off(0.6)
    upper.take_off(1.2)
    alone = thrust((lower, upper))
    command(upper, "go_to", -1.0, 0.0, 0.0, 0.0, 2.0, relative=True)
    thrust((lower, upper), 4.0)
    below = thrust((lower, upper))
    # As measured, with the PID controller of the firmware that holds the height.
    assert 1.05 < below / alone < 1.3
    assert air.move("seen", (0.0, 0.0, 0.6), 0.0) > 3.0
    assert lower.height == pytest.approx(0.6, abs=0.05)


def test_ground_effect_saves_thrust_near_the_ground():
    near, plain = Bench(ground_effect=True), Bench()
    for bench in (near, plain):
        command(bench, "takeoff", 0.05, 1.0)
        bench.run(6.0)
    # The model says 0.7 % at 5 cm.
    assert 0.99 < thrust((near,)) / thrust((plain,)) < 0.998
