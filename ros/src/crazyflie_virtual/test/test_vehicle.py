"""Whole flights on the bench: estimate, emergency stop, faults; more in test_recorded_*.py."""

import struct

import numpy as np
import pytest
from virtual_bench import Bench, generic

from crazyflie_virtual.crtp import Port
from crazyflie_virtual.firmware.supervisor import LOW, State

HOLD = generic(7, "ffff", 0.0, 0.0, 1.0, 0.0)
EMERGENCY_STOPS = {
    "supervisor": (Port.SUPERVISOR, 1, b"\x03"),
    "localization": (Port.LOCALIZATION, 1, b"\x03"),
}


@pytest.fixture
def flying():
    bench = Bench()
    bench.take_off()
    return bench


def tell_pose(bench, offset=(0.0, 0.0, 0.0)):
    """Send the true pose, moved by an offset, as an external one."""
    position = [a + b for a, b in zip(bench.physics.position, offset, strict=True)]
    data = struct.pack("<B7f", 8, *position, *bench.physics.quaternion)
    bench.ask(Port.LOCALIZATION, 1, data)


def test_hovers_within_a_centimetre(flying):
    flying.run(15.0)
    heights = []
    for _ in range(50):
        flying.run(0.1)
        heights.append(flying.physics.position)
    np.testing.assert_allclose(heights, [(0.0, 0.0, 1.0)] * 50, atol=0.01)


@pytest.mark.parametrize("options", [{"mass_error": 0.05}, {"thrust_error": -0.05}])
def test_hovers_though_it_is_not_nominal(options):
    bench = Bench(**options)
    bench.take_off()
    bench.run(15.0)
    assert bench.height == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_flies_to_positions_with_any_heading(yaw):
    bench = Bench(init_x=0.5, init_y=-0.5, init_yaw=yaw)
    degrees = np.degrees(yaw)
    bench.stream(generic(7, "ffff", 0.5, -0.5, 1.0, degrees), 4.0)
    bench.stream(generic(7, "ffff", 1.0, 0.0, 1.0, degrees), 5.0)
    assert bench.physics.position == pytest.approx((1.0, 0.0, 1.0), abs=0.1)


def test_the_high_level_commander_has_no_watchdog(flying):
    flying.run(20.0)
    assert flying.firmware.supervisor.state is State.FLYING
    assert flying.height == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("way", EMERGENCY_STOPS)
def test_emergency_stop(flying, way):
    flying.ask(*EMERGENCY_STOPS[way])
    flying.run(0.05)
    assert not flying.motors_run
    flying.run(1.0)
    assert flying.height == 0.0
    take_off = struct.pack("<BBff?f", 7, 0, 1.0, 0.0, False, 2.0)
    assert flying.ask_one(Port.HIGH_LEVEL, 0, take_off)[3] != 0
    (bits,) = struct.unpack("<H", flying.ask_one(Port.SUPERVISOR, 0, b"\x0c")[1:])
    assert bits & 0x40


@pytest.mark.parametrize("packet", [(Port.SUPERVISOR, 1, b"\x04"), (Port.LOCALIZATION, 1, b"\x04")])
def test_emergency_watchdog(flying, packet):
    for _ in range(5):
        flying.ask(*packet)
        flying.run(0.8)
    assert flying.motors_run
    flying.run(0.3)
    assert not flying.motors_run


def test_reset_restarts_at_once(flying):
    begin = flying.firmware
    flying.ask(Port.LINK, 3, b"\xfe\xff")
    flying.ask(Port.LINK, 3, b"\xfe\xf0\x01")
    assert flying.firmware is not begin
    flying.run(2.0)
    assert flying.height == 0.0


def test_switched_off_it_says_nothing_any_more(flying):
    assert len(flying.ask(Port.LINK, 3, b"\xfe\x01")) == 1
    assert flying.ask(Port.LINK, 3, b"\xfe\x03") == []


# The estimate.


def test_external_poses_come_before_the_deck(flying):
    for _ in range(500):
        # The motion capture's origin is elsewhere.
        tell_pose(flying, (0.5, 0.0, 0.0))
        flying.run(0.01)
    assert flying.physics.position[0] == pytest.approx(-0.5, abs=0.05)
    # And when they stop, the deck takes over.
    flying.run(6.0)
    assert flying.physics.position[0] == pytest.approx(0.0, abs=0.05)


def test_without_deck_it_flies_on_external_poses():
    bench = Bench(positioning="none", init_x=0.3)
    for k in range(1000):
        tell_pose(bench)
        if k == 50:
            bench.ask(Port.HIGH_LEVEL, 0, struct.pack("<BBff?f", 7, 0, 1.0, 0.0, False, 2.0))
        bench.run(0.01)
    assert bench.physics.position == pytest.approx((0.3, 0.0, 1.0), abs=0.05)


def test_without_deck_and_poses_the_estimate_drifts_away():
    bench = Bench(positioning="none", init_x=0.3)
    for _ in range(200):
        tell_pose(bench)
        bench.run(0.01)
    bench.take_off()
    for _ in range(100):
        tell_pose(bench)
        bench.run(0.01)
    bench.run(30.0)
    estimate = bench.firmware.estimate
    error = np.subtract((estimate.x, estimate.y, estimate.z), bench.physics.position)
    assert np.linalg.norm(error) > 0.05


def test_estimator_can_be_reset(flying):
    variance = flying.firmware.estimator.variance_position
    flying.firmware.deck.has_flow = flying.firmware.deck.has_lighthouse = False
    flying.firmware.reset_estimation = 1
    flying.run(0.02)
    assert flying.firmware.reset_estimation == 0
    assert flying.firmware.estimator.variance_position > 1e3 * variance


# Fault switches.


def test_motor_failure_ends_the_flight(flying):
    flying.vehicle.faults.motor_failure = 2
    speeds = []
    for _ in range(300):
        speeds.append(-flying.physics.velocity[2])
        flying.run(0.01)
    assert flying.height == 0.0
    assert max(speeds) > 0.5


def test_low_battery_is_reported_and_the_flight_goes_on(flying):
    flying.vehicle.faults.low_battery = 1
    flying.run(6.0)
    assert flying.firmware.power.state == LOW
    assert 3.0 < flying.firmware.power.voltage < 3.2
    assert flying.height > 0.8
    # It does not turn itself off, but has no thrust in the end.
    flying.run(60.0)
    assert flying.firmware.power.voltage < flying.firmware.power.critical_voltage
    assert flying.height == 0.0
    assert flying.ask_one(Port.LINK, 0, b"alive") == b"alive"


def test_battery_drains_in_flight(flying):
    charge = flying.vehicle.battery.charge
    flying.run(30.0)
    assert 0.05 < charge - flying.vehicle.battery.charge < 0.1


def test_the_same_seed_gives_the_same_flight_however_often_it_is_asked():
    def flight(periods, seed):
        bench = Bench(seed=seed)
        bench.ask(Port.HIGH_LEVEL, 0, struct.pack("<BBff?f", 7, 0, 1.0, 0.0, False, 2.0))
        for period in periods:
            bench.run(period)
        return bench.physics.position

    assert flight([2.0], 1) == flight([0.01] * 200, 1)
    assert flight([2.0], 1) != flight([2.0], 2)


def test_a_brushless_vehicle_arms_when_its_motors_idle_and_stops_when_one_fails():
    bench = Bench(model="brushless", auto_arm=False)
    assert bench.ask_one(Port.SUPERVISOR, 1, b"\x01\x01")[1:] == b"\x01\x01"
    bench.run(0.1)
    assert bench.firmware.supervisor.state is State.ARMING
    bench.run(1.0)
    assert bench.firmware.supervisor.state is State.READY_TO_FLY
    bench.take_off()
    bench.vehicle.faults.motor_failure = 2
    bench.run(0.8)
    assert bench.firmware.supervisor.state is State.LOCKED
    assert not bench.motors_run


def test_a_brushless_vehicle_with_a_motor_that_stands_still_is_not_armed():
    bench = Bench(model="brushless", auto_arm=False, motor_failure=3)
    bench.ask_one(Port.SUPERVISOR, 1, b"\x01\x01")
    bench.run(1.3)
    assert bench.firmware.supervisor.state is State.PRE_FL_CHECKS_PASSED
    assert not bench.motors_run
