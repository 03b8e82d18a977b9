"""The scenarios that were recorded on a later day; their times are good to 5 %."""

import math
import random
import struct

import pytest
from flight_recorder import HEIGHT, NEAR, PEAK, TURN, CommandedFlight, circle, position
from recording import recorded
from virtual_bench import SETPOINTS_STOP, attitude, generic

from crazyflie_virtual.crtp import Port
from crazyflie_virtual.quaternions import compress_quaternion

SLACK = 0.05
QUARTER = math.pi / 2.0

EMERGENCY_STOP, WATCHDOG = 3, 4
POWER_OFF, POWER_ON = b"\xfe\x02", b"\xfe\x03"


def climbed(height, duration=2.0, **settings):
    """Return a flight 3 s after the high-level commander began to take off."""
    flight = CommandedFlight(**settings)
    assert flight.fly("takeoff", height, duration) == 0
    flight.run(3.0)
    return flight


def on_a_circle(height=0.6):
    """Return a flight that has taken off and has a circle of 4 s as trajectory 1."""
    flight = climbed(height)
    flight.upload(circle())
    assert flight.fly("define_trajectory", 1, 0, 8) == 0
    return flight


def check_pose(flight, expected):
    """Compare with a recorded pose: x, y, z, yaw."""
    *place, yaw = expected
    assert flight.pose()[:3] == pytest.approx(place, abs=NEAR)
    assert flight.pose()[3] == pytest.approx(yaw, abs=TURN)


def test_go_to_relative_in_trajectory():
    firmware, flight = recorded("go_to_relative_in_trajectory"), on_a_circle()
    error = flight.fly("start_trajectory", 1, relative_position=True)
    assert error == firmware["start"]
    flight.run(1.5)
    begin = flight.pose()
    error = flight.fly("go_to", 0.3, 0.0, 0.2, 0.0, 2.0, relative=True)
    assert error == firmware["go_to"]
    flight.follow(firmware["moved"], begin, slack=SLACK)
    assert hex(flight.bits) == firmware["bits_end"]


def test_stop_then_takeoff():
    firmware, flight = recorded("stop_then_takeoff"), CommandedFlight()
    assert flight.fly("stop") == firmware["stop"]
    # By the time between the bits, a takeoff took 1.5 s.
    assert flight.fly("takeoff", 0.6, 1.5) == firmware["takeoff"]
    flight.run(3.0)
    assert flight.height == pytest.approx(firmware["z"], abs=HEIGHT)
    track = flight.begin(before_supervisor=0.02)
    assert flight.fly("stop") == firmware["stop_air"]
    flight.watch(0.15)
    assert flight.fly("takeoff", 0.6, 1.5) == firmware["takeoff_air"]
    flight.watch(3.0)
    track.check_bits([[0.02, "0x21e"], *firmware["bits"][1:]])
    track.check_heights(firmware["track_z"], (0.2, 0.5, 1.0, 1.7, 2.6))


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("spiral_clockwise", (-QUARTER, 0.5, 0.5, 0.0, 3.0, False, True)),
        ("spiral_full_turn", (4.0 * QUARTER, 0.4, 0.4, 0.0, 6.0)),
        ("spiral_sideways", (QUARTER, 0.5, 0.5, 0.0, 3.0, True)),
        ("spiral_radius_0", (QUARTER, 0.0, 0.5, 0.0, 3.0)),
        ("spiral_widening", (QUARTER, 0.3, 0.7, 0.3, 3.0)),
    ],
)
def test_spirals(name, arguments):
    firmware, flight = recorded(name), climbed(0.6)
    begin = flight.pose()
    assert flight.fly("spiral", *arguments) == firmware["errno"]
    flight.follow(firmware["track"], begin, slack=SLACK)
    assert hex(flight.bits) == firmware["bits_end"]


def test_groups():
    firmware, flight = recorded("groups"), CommandedFlight()
    assert flight.fly("set_group_mask", 4) == firmware["mask4"]
    assert flight.fly("takeoff", 0.5, 2.0, group_mask=4) == firmware["takeoff4"]
    flight.run(3.0)
    assert flight.height == pytest.approx(firmware["z"], abs=HEIGHT)
    for group in (2, 6):
        error = flight.fly("go_to", 0.4, 0.0, 0.5, 0.0, 2.0, group_mask=group)
        assert error == firmware[f"go_to{group}"]
        flight.run(2.0)
        assert flight.pose()[0] == pytest.approx(firmware[f"x{group}"], abs=NEAR)
    assert flight.fly("start_trajectory", 1, group_mask=3) == firmware["traj3"]
    assert flight.fly("stop", group_mask=3) == firmware["stop3"]
    flight.run(2.0)
    check_pose(flight, firmware["pose"])
    assert flight.fly("set_group_mask", 0) == firmware["mask0"]
    assert flight.fly("land", 0.0, 2.0, group_mask=1) == firmware["land1"]
    flight.run(3.0)
    assert flight.height == pytest.approx(firmware["z_end"], abs=HEIGHT)


@pytest.mark.parametrize(("blocks", "rates"), [(1, "n_per_s"), (3, "three_n_per_s")])
def test_log_26_bytes(blocks, rates):
    firmware, flight = recorded("log_26_bytes"), CommandedFlight()
    # 6 floats and a number of 16 bits; which variables they are does not matter.
    block = bytes(n for k in range(6) for n in (7, k, 0)) + bytes((2, 6, 0))
    flight.unsolicited.clear()
    for number in range(blocks):
        assert flight.ask_one(Port.LOG, 1, bytes((6, number)) + block)[2] == 0
        assert flight.ask_one(Port.LOG, 1, bytes((3, number, firmware["step_ms"] // 10)))[2] == 0
    flight.run(1.0)
    packets = [each.data for each in flight.unsolicited if each.port == Port.LOG]
    expected = firmware[rates] if blocks == 1 else firmware[rates][0]
    for number in range(blocks):
        stamps = [int.from_bytes(each[1:4], "little") for each in packets if each[0] == number]
        assert len(stamps) == pytest.approx(expected, abs=1)
        steps = {b - a for a, b in zip(stamps, stamps[1:], strict=False)}
        assert steps == {firmware["step_ms"]}
    assert {len(each) for each in packets} == {4 + 26}


def test_log_26_bytes_keeps_the_low_byte():
    flight = CommandedFlight()
    flight.run(2.0)
    assert flight.bits & 0xFF == recorded("log_26_bytes")["converted"]["supervisor.info"]


def test_arm_fly_disarm():
    firmware, flight = recorded("arm_fly_disarm"), CommandedFlight()
    assert flight.ask_one(Port.PLATFORM, 0, bytes((1, 1))).hex() == firmware["arm"][0]
    flight.run(1.0)
    assert flight.fly("takeoff", 0.5, 1.5) == firmware["takeoff"]
    flight.run(3.0)
    assert flight.height == pytest.approx(firmware["z"], abs=HEIGHT)
    assert flight.fly("land", 0.0, 1.0) == firmware["land"]
    flight.run(3.2)
    track = flight.begin(before_supervisor=0.04)
    assert flight.ask_one(Port.PLATFORM, 0, bytes((1, 0))).hex() == firmware["disarm"][0]
    flight.watch(0.05)
    assert flight.fly("takeoff", 0.5, 1.5) == firmware["takeoff2"]
    flight.watch(2.5)
    track.check_bits(firmware["bits"])
    assert flight.height == pytest.approx(firmware["z2"], abs=1e-3)


def test_hover_velocity_nan():
    firmware, flight = recorded("hover_velocity_nan"), CommandedFlight()
    flight.watch(3.0, generic(10, "ffff", 0.0, 0.0, 0.0, 0.6))
    track = flight.begin()
    flight.watch(0.5, generic(10, "ffff", 0.0, 0.0, 0.0, math.nan))
    flight.watch(2.0, generic(10, "ffff", 0.0, 0.0, 0.0, 0.6))
    track.check_heights(firmware["track_z"], (0.5, 1.0, 1.5, 2.0))
    track.check_bits([[0.0, firmware["bits"][0][1]]])
    track = flight.begin()
    flight.watch(0.5, generic(8, "ffff", math.nan, 0.0, 0.0, 0.0))
    flight.watch(2.0, position(0.0, 0.0, 0.6))
    for time, *place, _ in firmware["track"]:
        assert track.height(time, place[2]) == pytest.approx(place[2], abs=HEIGHT)
        # The vehicle comes back from its lateral motion by the end.
        assert track.coordinate(time, place[0], 0) == pytest.approx(place[0], abs=0.08)
    track.check_bits([[0.0, firmware["bits2"][0][1]]])


def full_state(height, word):
    """Return a full state setpoint at a height with an attitude in 32 bits."""
    return generic(6, "9hI3h", 0, 0, round(1000.0 * height), *[0] * 6, word, 0, 0, 0)


def test_full_state_bad_quaternion():
    """The heading becomes NaN: there is no output about the vertical, and integrals end up low."""
    firmware, flight = recorded("full_state_bad_quaternion"), CommandedFlight()
    flight.watch(4.0, position(0.0, 0.0, 0.6))
    track = flight.begin()
    # By the headings, 1 s and 2 s.
    flight.watch(1.0, full_state(0.6, 0xFFFFFFFF))
    check_pose(flight, firmware["pose1"])
    flight.watch(2.0, full_state(0.6, compress_quaternion((0.0, 0.0, 0.0, 1.0))))
    check_pose(flight, firmware["pose2"])
    track.check_bits([[0.0, firmware["bits"][0][1]]])


def test_emergency_reboot():
    firmware, flight = recorded("emergency_reboot"), climbed(0.6)
    track = flight.begin(before_supervisor=0.02)
    assert flight.supervise(EMERGENCY_STOP) == []
    flight.watch(1.5)
    track.check_bits([[0.01, "0x31e"], *firmware["bits"]])
    assert flight.fly("takeoff", 0.5, 2.0) == firmware["takeoff_refused"]
    flight.ask(Port.LINK, 3, POWER_OFF)
    flight.run(0.8)
    flight.ask(Port.LINK, 3, POWER_ON)
    flight.run(4.0)
    assert hex(flight.bits) == firmware["bits_new"]
    assert flight.fly("takeoff", 0.5, 2.0) == firmware["takeoff"]
    flight.run(3.0)
    assert flight.height == pytest.approx(firmware["z"], abs=HEIGHT)


def test_watchdog_in_flight():
    firmware, flight = recorded("watchdog_in_flight"), climbed(0.6)
    for _ in range(10):
        assert flight.supervise(WATCHDOG) == []
        flight.run(0.2)
    assert flight.height == pytest.approx(firmware["z"], abs=HEIGHT)
    track = flight.begin()
    flight.watch(2.5)
    track.check(firmware)


def test_go_to_in_takeoff():
    firmware, flight = recorded("go_to_in_takeoff"), CommandedFlight()
    assert flight.fly("takeoff", 0.8, 2.0) == 0
    flight.run(0.5)
    assert flight.fly("go_to", 0.5, 0.0, 0.8, 0.0, 2.0) == firmware["go_to"]
    # The times are those since the takeoff.
    track = [(time - 0.5, *pose) for time, *pose in firmware["track"]]
    flight.follow(track, slack=SLACK)


def test_trajectory_fast_restart_land():
    firmware, flight = recorded("trajectory_fast_restart_land"), on_a_circle()
    assert flight.fly("start_trajectory", 1, 0.5) == firmware["fast"]
    flight.follow(firmware["fast_track"], slack=SLACK)

    def restart():
        error = flight.fly("start_trajectory", 1, 1.0, relative_position=True)
        assert error == firmware["again"]

    restart()
    first, *others = firmware["again_track"]
    flight.follow([first])
    restart()
    flight.follow([(time - first[0], *pose) for time, *pose in others], slack=SLACK)
    restart()
    flight.run(1.0)
    assert flight.fly("land", 0.0, 2.0) == firmware["land"]
    flight.watch(4.0)
    assert flight.height == pytest.approx(firmware["end"][2], abs=1e-3)
    assert flight.yaw == pytest.approx(firmware["end"][3], abs=1.0)


def test_high_level_off_and_reset():
    firmware, flight = recorded("high_level_off_and_reset"), CommandedFlight()
    flight.firmware.commander.high_level_enabled = 0
    assert flight.fly("takeoff", 0.5, 2.0) == firmware["takeoff_off"]
    flight.run(3.0)
    assert flight.height == pytest.approx(firmware["z_off"], abs=HEIGHT)
    flight.firmware.commander.high_level_enabled = 1
    assert flight.fly("takeoff", 0.5, 2.0) == firmware["takeoff_on"]
    flight.run(3.0)
    assert flight.height == pytest.approx(firmware["z_on"], abs=HEIGHT)
    track = flight.begin()
    flight.firmware.reset_estimation = 1
    flight.watch(2.0)
    assert flight.height == pytest.approx(firmware["z_after_reset"], abs=HEIGHT)
    track.check_bits(firmware["bits"])


def test_setpoint_below_ground():
    firmware, flight = recorded("setpoint_below_ground"), CommandedFlight()
    flight.watch(4.0, position(0.0, 0.0, 0.4))
    track = flight.begin()
    flight.watch(3.0, position(0.0, 0.0, -0.3))
    track.check_heights(firmware["track_z"], (0.3, 1.0, 2.0, 3.0))
    commands = flight.firmware.stabilizer.commands
    assert sum(commands) / 4.0 == pytest.approx(firmware["motors_at_ground"], abs=PEAK)
    flight.watch(2.5, attitude(thrust=0))
    assert hex(flight.bits) == firmware["bits"]
    assert flight.ask(*SETPOINTS_STOP) == []
    assert flight.fly("takeoff", 0.4, 2.0) == firmware["takeoff"]
    flight.run(3.0)
    assert flight.height == pytest.approx(firmware["z"], abs=HEIGHT)


def test_mellinger():
    firmware, flight = recorded("mellinger"), CommandedFlight()
    flight.firmware.stabilizer.controller = 2
    assert flight.fly("takeoff", 0.6, 2.0) == firmware["takeoff"]
    flight.run(4.0)
    check_pose(flight, firmware["pose"])
    assert flight.fly("go_to", 0.5, 0.0, 0.6, 0.0, 2.0) == 0
    flight.run(4.0)
    check_pose(flight, firmware["pose2"])
    flight.firmware.stabilizer.controller = 1
    flight.run(2.0)
    check_pose(flight, firmware["pose3"])
    assert hex(flight.bits) == firmware["bits"]


def test_external_position_flight():
    firmware, noise = recorded("external_position_flight"), random.Random(1)
    flight = CommandedFlight(positioning="none")

    def measure(duration):
        """Send the true position at 30 Hz."""
        for _ in range(round(30.0 * duration)):
            place = (x + noise.gauss(0.0, 0.002) for x in flight.physics.position)
            flight.ask(Port.LOCALIZATION, 0, struct.pack("<3f", *place))
            flight.run(1.0 / 30.0)

    def error():
        return math.dist(flight.physics.position, firmware["pose"][:3])

    measure(2.0)
    assert flight.fly("takeoff", 0.5, 2.0) == firmware["takeoff"]
    measure(4.0)
    assert flight.height == pytest.approx(firmware["z"], abs=HEIGHT)
    assert flight.fly("go_to", 0.3, 0.0, 0.5, 0.0, 2.0) == 0
    measure(4.0)
    check_pose(flight, firmware["pose"])
    flight.run(1.0)
    assert (error() < 0.3) == firmware["after_1s_flies_within_0.3m"]
    measure(2.0)
    assert (error() < 0.1) == firmware["back_within_0.1m"]
    flight.run(4.0)
    assert hex(flight.bits) == firmware["bits"][0][1]


def test_compressed():
    firmware, flight = recorded("compressed"), CommandedFlight()

    def segment(*points):
        # x is cubic, the other axes are constant.
        return struct.pack("<BH3h", 0b10, 1500, *points)

    data = struct.pack("<4h", 0, 0, 600, 0) + segment(0, 600, 600) + segment(600, 0, 0)
    flight.upload(data + bytes(3))
    define = flight.ask_one(Port.HIGH_LEVEL, 0, struct.pack("<4BIB", 6, 1, 1, 1, 0, 2))
    assert define[3] == firmware["define"]
    assert flight.fly("takeoff", 0.6, 2.0) == 0
    flight.run(3.0)
    assert flight.fly("start_trajectory", 1) == firmware["start"]
    flight.follow(firmware["track"], slack=SLACK)
    begin = flight.pose()
    error = flight.fly("start_trajectory", 1, relative_position=True)
    assert error == firmware["start_rel"]
    flight.follow(firmware["rel"], begin, slack=SLACK)
    begin = flight.pose()
    error = flight.fly("start_trajectory", 1, 2.0, relative_position=True)
    assert error == firmware["slow"]
    flight.follow(firmware["slow_rel"], begin, slack=SLACK)


def test_position_takeoff_turned():
    """The outputs about the vertical reduce the thrust, which keeps the vehicle on the ground.

    It turns there by itself, twice as fast as the recorded one: the ground differs. When the
    heading is given up, it jumps by the integral of the height.
    """
    firmware, flight = recorded("position_takeoff_turned"), CommandedFlight()
    flight.watch(1.0, position(0.0, 0.0, 0.5, 30.0))
    first, second, third, fourth = flight.firmware.stabilizer.commands
    assert (second, fourth) == pytest.approx(firmware["motors_at_1s"][1::2], abs=PEAK)
    assert max(first, third) < 0.25 * min(second, fourth)
    flight.watch(2.9, position(0.0, 0.0, 0.5, 30.0))
    assert flight.height == firmware["track"][-1][3]
    assert 0.0 < flight.yaw < 3.0 * firmware["track"][-1][4]
    track = flight.begin()
    flight.watch(3.0, position(0.0, 0.0, 0.5, 0.0))
    assert (flight.height > 0.5) != firmware["flew"]
    heights = [row[3][2] for row in track.rows]
    assert max(heights) == pytest.approx(firmware["z_yaw_0"], abs=0.1)
