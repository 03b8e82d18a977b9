"""Who is listened to, and what is said of it; more in test_recorded_*.py."""

import errno
import math
import struct

import pytest
from virtual_bench import SETPOINTS_STOP, Bench, attitude, generic

from crazyflie_model.supervisor import SupervisorState
from crazyflie_virtual.body import STEP
from crazyflie_virtual.crtp import Port
from crazyflie_virtual.firmware.supervisor import State

HOLD = generic(7, "ffff", 0.0, 0.0, 1.0, 0.0)
LAND = struct.pack("<BBff?f", 8, 0, 0.0, 0.0, False, 2.0)


def test_high_level_plans_from_the_vehicles_state_after_a_stream():
    bench = Bench()
    bench.take_off()
    bench.stream(generic(7, "ffff", 1.0, -0.5, 1.5, 0.0), 6.0)
    bench.ask(*SETPOINTS_STOP)
    go_to = struct.pack("<4B5f", 12, 0, 1, 0, 0.0, 0.0, 0.0, 0.0, 1.0)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, go_to)[3] == 0
    bench.run(2.0)
    x, y, z = bench.physics.position
    assert abs(x - 1.0) < 0.05
    assert abs(y + 0.5) < 0.05
    assert abs(z - 1.5) < 0.1


def said(bench):
    """Return what is on the console."""
    # The console speaks to clients that have been heard of.
    assert bench.ask(Port.LINK, 0, b"?")
    bench.run(0.2)
    return b"".join(p.data for p in bench.unsolicited if p.port == Port.CONSOLE).decode()


def test_it_says_once_that_a_locked_vehicle_takes_no_setpoints():
    bench = Bench()
    bench.firmware.supervisor.stop()
    bench.run(0.2)
    bench.unlock()
    bench.stream(attitude(thrust=50000), 3.0)
    assert said(bench).count("CMD: setpoints have no effect: Locked") == 1


def test_it_says_why_a_high_level_command_does_nothing():
    bench = Bench()
    bench.stream(attitude(thrust=0), 0.2)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, LAND)[3] == 0
    assert "HLC: command 8 has no effect before setpoints stop" in said(bench)
    bench.run(1.0)
    bench.firmware.supervisor.stop()
    bench.run(0.2)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, LAND)[3] == errno.EBUSY
    assert "HLC: refused command 8: Locked" in said(bench)


def test_thrust_without_unlocking_prints_a_warning():
    bench = Bench()
    bench.stream(attitude(thrust=50000), 0.2)
    assert "CMD: thrust is locked" in said(bench)


@pytest.mark.parametrize(
    "goal",
    [(math.nan, 0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0, math.inf, 1.0), (0.0, 0.0, 1.0, 0.0, 1e30)],
)
def test_a_goal_that_is_not_a_number_ends_in_levelling_out(goal):
    # The planner disables itself (planner.c); no setpoints, then, as when a stream ends.
    bench = Bench()
    bench.take_off()
    go_to = struct.pack("<4B5f", 12, 0, 0, 0, *goal)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, go_to)[3] == 0
    bench.run(1.0)
    assert all(map(math.isfinite, bench.physics.position))
    if not math.isfinite(sum(goal)):
        assert SupervisorState.HIGH_LEVEL_DISABLED in bench.firmware.info
        assert bench.firmware.supervisor.state is State.WARNING_LEVEL_OUT
        bench.run(1.5)
        assert bench.firmware.supervisor.state is State.LOCKED
        assert "not a number" in said(bench)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("kind", [1, 2, 4, 5, 7, 8, 9, 10, 11])
def test_setpoints_that_are_no_numbers_are_survived(kind, value):
    bench = Bench()
    bench.stream(HOLD, 0.6)
    form, values = "ffff", [value] * 4
    if kind == 11:
        form, values = "fffHB", [value, value, value, 42000, 0]
    bench.stream(generic(kind, form, *values), 0.2)
    bench.stream(attitude(roll=value, pitch=value, yaw_rate=value), 0.2)
    bench.stream(HOLD, 0.2)
    assert all(map(math.isfinite, bench.firmware.stabilizer.commands))
    assert all(map(math.isfinite, bench.physics.position))


def test_under_a_stream_disarming_stops_the_motors_for_a_moment():
    bench = Bench()
    bench.stream(HOLD, 4.0)
    bench.ask(Port.SUPERVISOR, 1, b"\x01\x00")
    bench.stream(HOLD, 0.1)
    assert not bench.motors_run
    bench.stream(HOLD, 0.2)
    assert bench.motors_run
    bench.stream(HOLD, 3.0)
    assert abs(bench.height - 1.0) < 0.15


def test_motors_idle_where_the_client_arms():
    bench = Bench(auto_arm=False)
    bench.run(0.2)
    assert not bench.motors_run
    bench.ask(Port.SUPERVISOR, 1, b"\x01\x01")
    bench.run(0.2)
    assert bench.firmware.stabilizer.commands == (7000.0,) * 4
    assert State.READY_TO_FLY is bench.firmware.supervisor.state


def test_motors_idle_in_the_moment_of_arming_already():
    bench = Bench(auto_arm=False)
    bench.ask(Port.SUPERVISOR, 1, b"\x01\x01")
    # Setpoints are not flown yet.
    bench.unlock()
    bench.ask(*attitude(thrust=30000))
    while bench.firmware.supervisor.state is State.PRE_FL_CHECKS_PASSED:
        assert not bench.motors_run
        bench.run(STEP)
    assert bench.firmware.supervisor.state is State.ARMING
    assert not bench.firmware.supervisor.can_fly
    assert bench.firmware.stabilizer.commands == (7000.0,) * 4
    bench.run(0.1)
    assert max(bench.firmware.stabilizer.commands) > 29000.0
