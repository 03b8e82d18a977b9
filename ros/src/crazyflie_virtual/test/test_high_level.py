"""High-level commands that no record has; the others are in test_recorded_*.py."""

import errno
import math
import struct

import pytest
from virtual_bench import Bench, command

from crazyflie_model.supervisor import SupervisorState
from crazyflie_virtual.crtp import Port
from crazyflie_virtual.firmware.planner import REFUSED


@pytest.fixture
def bench():
    return Bench()


def test_takeoff_follows_the_polynomial(bench):
    assert command(bench, "takeoff", 1.0, 2.0) == 0
    for k in range(1, 21):
        bench.run(0.1)
        s = k / 20
        expected = 35 * s**4 - 84 * s**5 + 70 * s**6 - 20 * s**7
        assert bench.firmware.setpoint.z == pytest.approx(expected, abs=0.01)
    bench.run(4.0)
    assert bench.height == pytest.approx(1.0, abs=0.1)


def test_takeoff_turns_to_its_yaw_or_keeps_it():
    bench = Bench(init_yaw=0.5)
    command(bench, "takeoff", 0.5, 1.0, yaw=None)
    bench.run(3.0)
    assert bench.firmware.estimate.yaw == pytest.approx(math.degrees(0.5), abs=2.0)
    command(bench, "land", 0.0, 1.0, yaw=1.0)
    bench.run(0.98)
    assert bench.firmware.setpoint.yaw == pytest.approx(math.degrees(1.0), abs=1.0)


def test_flight_by_mellingers_controller(bench):
    for number, taken in ((7, 1), (2, 2)):
        name_and_type = b"\0stabilizer\0controller\0\x08"
        bench.ask_one(Port.PARAMETERS, 3, name_and_type + bytes([number]))
        assert bench.firmware.stabilizer.controller == taken
    bench.take_off()
    command(bench, "go_to", 1.0, -0.5, 1.5, math.pi / 2, 3.0)
    lag = 0.0
    for _ in range(30):
        bench.run(0.1)
        lag = max(lag, abs(bench.firmware.setpoint.x - bench.firmware.estimate.x))
    # With the PID controller it lags by 0.36 m.
    assert lag < 0.1
    bench.run(3.0)
    assert bench.physics.position == pytest.approx((1.0, -0.5, 1.5), abs=0.06)
    assert bench.firmware.estimate.yaw == pytest.approx(90.0, abs=2.0)
    command(bench, "land", 0.0, 2.0)
    bench.run(2.5)
    assert bench.height == 0.0
    assert not bench.motors_run


@pytest.mark.parametrize("angle", [math.nan, math.inf])
def test_a_spiral_that_is_not_a_number_levels_out(bench, angle):
    bench.take_off()
    error = command(bench, "spiral", angle, 0.4, math.nan, 0.0, 2.0)
    assert error == 0
    bench.run(0.1)
    assert SupervisorState.HIGH_LEVEL_DISABLED in bench.firmware.info
    assert command(bench, "takeoff", 1.0, 2.0) == REFUSED


def test_the_groups_are_a_parameter(bench):
    name = b"hlCommander\0groupmask\0"
    assert bench.ask_one(Port.PARAMETERS, 3, b"\0" + name + b"\x08\x02")[-1] == 0
    for mask, flies in ((0b01, False), (0b11, True)):
        assert command(bench, "takeoff", 1.0, 1.0, group_mask=mask) == 0
        bench.run(1.0)
        assert (bench.height > 0.3, bench.height > 0.0) == (flies, flies)


@pytest.mark.parametrize(
    ("takeoff", "land"),
    [
        (("<BBff", 1, 0, 0.5, 1.0), ("<BBff", 2, 0, 0.0, 1.0)),
        (
            ("<BBf?f?f", 9, 0, 0.5, True, 0.0, False, 0.5),
            ("<BBf?f?f", 10, 0, 0.5, True, 0.0, False, 0.5),
        ),
    ],
)
def test_other_takeoffs(bench, takeoff, land):
    assert bench.ask_one(Port.HIGH_LEVEL, 0, struct.pack(*takeoff))[3] == 0
    bench.run(4.0)
    assert bench.height == pytest.approx(0.5, abs=0.1)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, struct.pack(*land))[3] == 0
    bench.run(2.0)
    assert bench.height == 0.0


def test_a_command_that_is_too_short(bench):
    assert bench.ask_one(Port.HIGH_LEVEL, 0, b"\x07\x00")[3] == errno.EINVAL
    bench.run(0.5)
    assert bench.height == 0.0
