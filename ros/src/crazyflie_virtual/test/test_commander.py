"""Who is listened to, and when thrust counts."""

import struct

from virtual_bench import SETPOINTS_STOP, Bench, attitude, generic

from crazyflie_virtual.firmware.commander import HIGH_LEVEL, NOBODY, STREAMED
from crazyflie_virtual.firmware.planner import Phase
from crazyflie_virtual.link.crtp import Port

HOLD = generic(7, "ffff", 0.0, 0.0, 1.0, 0.0)
LAND = struct.pack("<BBff?f", 8, 0, 0.0, 0.0, False, 2.0)


def test_thrust_is_locked_until_there_was_none():
    bench = Bench()
    bench.stream(attitude(thrust=50000), 0.5)
    assert not bench.motors_run
    bench.unlock()
    bench.stream(attitude(thrust=50000), 0.5)
    assert bench.motors_run
    assert bench.height > 0.05


def test_thrust_lock_closes_with_a_new_client():
    bench = Bench()
    bench.unlock()
    assert bench.ask_one(Port.LINK, 1, b"\0").startswith(b"Bitcraze Crazyflie")
    bench.stream(attitude(thrust=50000), 0.2)
    assert not bench.motors_run


def test_generic_setpoints_need_no_unlocking():
    bench = Bench()
    bench.stream(HOLD, 2.0)
    assert bench.height > 0.5


def test_streamed_setpoints_keep_the_high_level_commander_out_until_told():
    bench = Bench()
    bench.take_off()
    bench.stream(HOLD, 1.0)
    assert bench.firmware.commander.priority == STREAMED
    assert bench.firmware.planner.phase is Phase.DISABLED
    # Accepted, but without effect as long as the vehicle hears a stream.
    assert bench.ask_one(Port.HIGH_LEVEL, 0, LAND)[3] == 0
    bench.stream(HOLD, 3.0)
    assert bench.height > 0.9
    bench.ask(*SETPOINTS_STOP)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, LAND)[3] == 0
    bench.run(3.0)
    assert bench.height == 0.0
    assert not bench.motors_run
    assert bench.firmware.commander.priority == HIGH_LEVEL


def test_the_end_of_a_stream_alone_does_not_let_the_high_level_commander_land():
    bench = Bench()
    bench.take_off()
    bench.stream(HOLD, 1.0)
    bench.ask(Port.HIGH_LEVEL, 0, LAND)
    bench.run(0.4)
    assert bench.firmware.commander.priority == STREAMED
    assert bench.height > 0.9


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


def test_a_new_client_on_the_ground_finds_the_commander_free():
    bench = Bench()
    bench.unlock()
    bench.run(5.0)
    assert bench.firmware.commander.priority == STREAMED
    bench.ask(Port.LINK, 1, b"\0")
    assert bench.firmware.commander.priority == NOBODY
    bench.take_off()


def test_a_new_client_in_flight_changes_nothing():
    bench = Bench()
    bench.take_off()
    bench.stream(HOLD, 0.5)
    bench.ask(Port.LINK, 1, b"\0")
    bench.stream(HOLD, 1.0)
    assert bench.firmware.commander.priority == STREAMED
    assert bench.height > 0.9


def test_high_level_commander_can_be_switched_off():
    bench = Bench()
    bench.firmware.commander.high_level_enabled = 0
    take_off = struct.pack("<BBff?f", 7, 0, 1.0, 0.0, False, 2.0)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, take_off)[3] == 0
    bench.run(2.0)
    assert bench.height == 0.0
