"""High-level commander and supervisor: the recorded flights of the firmware, flown again."""

import struct

import pytest
from flight_recorder import HEIGHT, MOMENT, PEAK, Flight
from recording import recorded
from virtual_bench import attitude

from crazyflie_virtual.crtp import Port

ARM, RECOVER, EMERGENCY_STOP, WATCHDOG = 1, 2, 3, 4


def hovering(height):
    """Return a flight that has taken off by the high-level commander."""
    flight = Flight()
    assert flight.up(height) == 0
    flight.run(5.0)
    return flight


def go_to(flight, x, y, z, duration, group=0):
    """Return the error number of the command to go somewhere."""
    data = struct.pack("<4B5f", 12, group, 0, 0, x, y, z, 0.0, duration)
    return flight.ask_one(Port.HIGH_LEVEL, 0, data)[3]


def test_takeoff_land():
    firmware = recorded("takeoff_land")
    flight = Flight()
    track = flight.begin()
    assert flight.up(0.5) == firmware["takeoff_errno"]
    flight.watch(5.0)
    track.check_bits(firmware["bits_up"])
    track.check_heights(firmware["track_z"], (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0))
    assert max(row[3][2] for row in track.rows) == pytest.approx(firmware["z_max"], abs=HEIGHT)
    commands = flight.firmware.stabilizer.commands
    assert sum(commands) / 4.0 == pytest.approx(firmware["motor_mean_hover"], rel=0.01)
    track = flight.begin(before_supervisor=0.02)
    assert flight.land() == firmware["land_errno"]
    errors = []
    for _ in range(90):
        flight.watch(0.1)
        error = go_to(flight, 0.0, 0.0, 0.5, 1.0, group=0x80)
        time = flight.vehicle.time - track.began
        if time > 2.5 and (not errors or error != errors[-1][1]):
            errors.append((time, error))
    track.check_bits(firmware["bits_down"])
    track.check_motors(firmware["motors_on_off_down"])
    track.check_heights(firmware["track_z_land"], (0.5, 1.0, 1.5, 2.0, 2.5, 3.0))
    assert flight.height == firmware["z_after_land"]
    expected = firmware["errno_of_ignored_go_to_over_time"]
    assert [error for _, error in errors] == [error for _, error in expected]
    for (time, _), (moment, _) in zip(errors[1:], expected[1:], strict=True):
        assert time == pytest.approx(moment, abs=0.1 + MOMENT)


def test_takeoff_twice_land_twice():
    firmware = recorded("takeoff_twice_land_twice")
    flight = hovering(0.5)
    assert flight.up(1.0) == firmware["takeoff_while_flying_errno"]
    flight.run(3.0)
    assert flight.height == pytest.approx(firmware["z_after"], abs=HEIGHT)
    assert flight.land() == firmware["land1"]
    flight.run(0.2)
    assert flight.land() == firmware["land2"]
    flight.run(4.5)
    assert flight.height == firmware["z_landed"]
    track = flight.begin(before_supervisor=0.02)
    # By the time between the bits, this landing took 1 s.
    flight.watch(0.02)
    assert flight.land(1.0) == firmware["land_on_ground_errno"]
    flight.watch(2.0)
    track.check_bits(firmware["bits_after"])
    assert flight.highest == pytest.approx(firmware["land_on_ground_motors_max"], abs=PEAK)


def test_hl_stop_in_flight():
    firmware = recorded("hl_stop_in_flight")
    flight = hovering(0.6)
    track = flight.begin(before_supervisor=0.02)
    assert flight.command(3, "") == firmware["stop_errno"]
    flight.watch(4.0)
    track.check(firmware)
    ground = next(time for time, *_, place in track.rows if place[2] == 0.0)
    assert ground == pytest.approx(firmware["t_ground"], abs=MOMENT)
    # The times of the record go on from the stop; the takeoff took 1.5 s.
    flight.await_supervisor(0.002)
    assert flight.up(0.4, 1.5) == firmware["takeoff_errno"]
    flight.watch(3.0)
    track.check_bits([[0.02, "0x21e"], *firmware["bits_after"]])
    assert flight.height == pytest.approx(firmware["z_after"], abs=HEIGHT)


def test_emergency_stop():
    firmware = recorded("emergency_stop")
    flight = hovering(0.6)
    track = flight.begin(before_supervisor=0.02)
    assert flight.supervise(EMERGENCY_STOP) == []
    flight.watch(3.0)
    track.check(firmware)
    assert flight.supervise(RECOVER) == firmware["recover_reply"]
    assert flight.supervise(ARM, 1) == firmware["arm_reply"]
    assert flight.up(0.4) == firmware["takeoff_errno"]
    assert flight.command(3, "") == firmware["stop_errno"]
    assert flight.command(13, "???Bf", False, False, False, 0, 1.0) == firmware["start_traj_errno"]
    assert flight.land() == firmware["land_errno"]
    flight.begin()
    flight.watch(0.5, attitude(thrust=0))
    flight.watch(0.5, attitude(thrust=30000))
    assert flight.highest == firmware["motors_max_after"]
    assert hex(flight.bits) == firmware["bits_end"]
    assert int(firmware["param_still_readable"]) == flight.firmware.supervisor.emergency_stop


def test_emergency_watchdog():
    firmware = recorded("emergency_watchdog")
    flight = Flight()
    track = flight.begin()
    for _ in range(10):
        assert flight.supervise(WATCHDOG) == []
        flight.watch(0.2)
    track.check_bits(firmware["bits_while_fed"])
    track = flight.begin()
    flight.watch(2.0)
    track.check_bits(firmware["bits_starved"])
    assert hex(flight.bits) == firmware["bits_end"]


def test_param_stop():
    firmware = recorded("param_stop")
    flight = Flight()
    track = flight.begin(before_supervisor=0.02)
    flight.firmware.supervisor.emergency_stop = 1
    flight.watch(0.5)
    flight.firmware.supervisor.emergency_stop = 0
    flight.watch(0.5)
    track.check_bits(firmware["bits"])
    assert flight.up(0.5) == firmware["takeoff_errno"]
    flight.run(2.0)
    assert flight.height == firmware["z"]


def test_disarm_in_hl_flight():
    firmware = recorded("disarm_in_hl_flight")
    flight = hovering(0.6)
    track = flight.begin(before_supervisor=0.04)
    assert flight.supervise(ARM, 0) == firmware["reply"]
    flight.watch(6.0)
    track.check(firmware)
    track.check_heights(firmware["track_z"], (0.0, 0.3, 0.8, 1.3, 1.8))
    assert flight.up(0.4) == firmware["takeoff_errno"]
    flight.watch(3.0)
    assert flight.height == pytest.approx(firmware["z"], abs=HEIGHT)
    assert hex(flight.bits) == firmware["bits_end"]


def test_arm_on_ground():
    firmware = recorded("arm_on_ground")
    flight = Flight()
    assert flight.supervise(ARM, 1) == firmware["arm"]
    track = flight.begin(before_supervisor=0.02)
    assert flight.supervise(ARM, 0) == firmware["disarm"]
    flight.watch(1.0)
    track.check_bits(firmware["bits"])
    assert flight.supervise(ARM, 1) == firmware["arm2"]
    for data, name in (
        ((ARM, 0), "platform_disarm"),
        ((ARM, 1), "platform_arm"),
        ((RECOVER,), "platform_recover"),
    ):
        assert flight.ask_one(Port.PLATFORM, 0, bytes(data)).hex() == firmware[name][0]
        flight.run(1.0)
    assert flight.supervise(RECOVER) == firmware["recover"]
    assert flight.supervise(ARM) == firmware["arm_no_data"]
    assert _info(flight, 12) == firmware["info_bits"]
    assert {str(i): _info(flight, i) for i in range(1, 12)} == firmware["info_single"]
    assert _info(flight, 13) == firmware["info_unknown"]
    assert flight.up(0.3, 1.0) == firmware["takeoff_errno"]
    flight.run(2.0)
    assert flight.height == pytest.approx(firmware["z"], abs=HEIGHT)


def _info(flight, question):
    answers = flight.ask(Port.SUPERVISOR, 0, bytes([question]))
    return [answer.data.hex() for answer in answers]


def test_reconnect_in_flight():
    firmware = recorded("reconnect_in_flight")
    flight = hovering(0.5)
    track = flight.begin()
    flight.watch(3.0)
    assert flight.height == pytest.approx(firmware["z_without_client"], abs=HEIGHT)
    flight.ask(Port.LINK, 1, b"\0")
    flight.watch(1.0)
    assert flight.height == pytest.approx(firmware["z_after_reconnect"], abs=HEIGHT)
    track.check_bits(firmware["bits"])
    assert go_to(flight, 0.3, 0.0, 0.5, 2.0) == firmware["goto_errno"]
    flight.run(3.0)
    x, y, z, yaw = firmware["pose"]
    assert flight.physics.position == pytest.approx((x, y, z), abs=HEIGHT)
    assert flight.yaw == pytest.approx(yaw, abs=1.0)
    assert flight.land() == firmware["land_errno"]
    flight.run(4.0)
    assert flight.height == firmware["z_end"]


def test_reconnect_on_ground():
    firmware = recorded("reconnect_on_ground")
    flight = Flight()
    flight.watch(0.5, attitude(thrust=0))
    flight.ask(Port.LINK, 1, b"\0")
    flight.run(0.5)
    assert hex(flight.bits) == firmware["bits"]
    assert flight.up(0.4) == firmware["errno"]
    flight.run(3.0)
    assert flight.height == firmware["z"]


def test_tumble():
    firmware = recorded("tumble")
    flight = hovering(1.0)
    track = flight.begin()
    flight.vehicle.faults.motor_failure = 2
    flight.watch(6.0)
    track.check(firmware)
    ground = next(time for time, *_, place in track.rows if place[2] == 0.0)
    assert ground == pytest.approx(firmware["t_ground"], abs=MOMENT)
    assert flight.supervise(RECOVER) == firmware["recover_while_lying"]
    assert flight.up(0.4) == firmware["takeoff_while_lying_errno"]
    assert flight.supervise(ARM, 1) == firmware["arm_while_lying"]
    assert hex(flight.bits) == firmware["bits_end"]
