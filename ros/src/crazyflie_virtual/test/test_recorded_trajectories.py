"""Trajectories and external poses as the real firmware flew them, replayed.

The firmware's vehicle and this one differ in their airframes, and a few steps of
the scenarios are told in words only, so that positions agree to centimetres.
"""

import errno
import math
import struct

import pytest
from flight_recorder import NEAR, CommandedFlight, circle
from recording import recorded

from crazyflie_virtual.crtp import Port


def test_go_to():
    flight, firmware = CommandedFlight(), recorded("go_to")
    flight.climb(0.5)
    assert flight.fly("go_to", 1.0, 0.0, 0.7, 1.57, 3.0) == firmware["abs_errno"]
    flight.follow(firmware["abs_track"])
    error = flight.fly("go_to", -0.5, 0.5, 0.0, 0.5, 2.0, relative=True)
    assert error == firmware["rel_errno"]
    flight.follow(firmware["rel_track"])
    error = flight.fly("go_to", 0.0, 0.0, 0.5, -3.0, 2.0, linear=True)
    assert error == firmware["lin_errno"]
    flight.follow(firmware["lin_track"])


def test_spiral():
    flight, firmware = CommandedFlight(), recorded("spiral")
    flight.climb(0.6)
    assert flight.fly("spiral", math.pi / 2, 0.5, 0.5, 0.2, 3.0) == firmware["errno"]
    flight.follow(firmware["track"])


def test_polynomials():
    flight, firmware = CommandedFlight(), recorded("poly4d")
    data = circle()
    assert len(data) == firmware["bytes"]
    flight.upload(data)
    assert flight.fly("define_trajectory", 1, 0, 8) == firmware["define"]
    flight.climb(0.6)
    assert flight.fly("start_trajectory", 1) == firmware["start_errno"]
    flight.follow(firmware["track_1x"])
    flight.run(2.0)
    assert flight.fly("start_trajectory", 1, 2.0, reversed=True) == firmware["start_rev_errno"]
    flight.follow(firmware["track_2x_rev"])
    flight.fly("go_to", 0.3, -0.3, 0.6, math.radians(46.0), 3.0)
    flight.run(6.0)
    start = flight.pose()
    error = flight.fly("start_trajectory", 1, relative_position=True)
    assert error == firmware["start_rel_errno"]
    track = [(*row[:4], row[4] + start[3]) for row in firmware["rel_track_from_start"]]
    flight.follow(track, (*start[:3], 0.0))
    # Positions of the last track are told by the heading at its start; there the recorded
    # vehicle was 7 cm from its setpoint.
    flight.fly("go_to", 0.3, -0.3, 0.6, math.radians(46.0), 3.0)
    flight.run(6.0)
    start = flight.pose()
    error = flight.fly("start_trajectory", 1, relative_position=True, relative_yaw=True)
    assert error == firmware["start_relyaw_errno"]
    flight.follow(firmware["relyaw_track_from_start"], start, near=0.1)


def test_start_of_what_is_not_defined():
    flight, firmware = CommandedFlight(), recorded("start_undefined")
    assert flight.fly("start_trajectory", 3) == firmware["ground_errno"]
    flight.run(1.0)
    assert flight.motors_run == firmware["ground_motors"]
    flight.climb(0.5)
    assert flight.fly("start_trajectory", 3) == firmware["flight_errno"]
    flight.run(1.0)
    assert flight.height == pytest.approx(firmware["z"], abs=NEAR)
    assert flight.fly("start_trajectory", 200) == firmware["id200_errno"]
    flight.run(1.0)
    assert flight.height == pytest.approx(firmware["z2"], abs=NEAR)


@pytest.mark.parametrize(
    ("name", "trajectory_id", "location", "kind", "offset", "pieces"),
    [
        ("ok", 0, 1, 0, 0, 1),
        ("id9", 9, 1, 0, 0, 1),
        ("id10", 10, 1, 0, 0, 1),
        ("id30", 30, 1, 0, 0, 1),
        ("id31", 31, 1, 0, 0, 1),
        ("pieces32", 1, 1, 0, 0, 32),
        ("offset4095", 1, 1, 0, 4095, 1),
        ("pieces0", 1, 1, 0, 0, 0),
        ("compressed", 1, 1, 1, 0, 1),
        ("type9", 1, 1, 9, 0, 1),
        ("location2", 1, 2, 0, 0, 1),
    ],
)
def test_definitions(name, trajectory_id, location, kind, offset, pieces):
    expected = recorded("define_errors")[name]
    define = struct.pack("<4BIB", 6, trajectory_id, location, kind, offset, pieces)
    answer = CommandedFlight().ask_one(Port.HIGH_LEVEL, 0, define)
    if isinstance(expected, list):
        assert [answer.hex()] == expected
    else:
        assert answer == define[:3] + bytes([expected])


def test_an_unknown_command():
    (answer,) = recorded("define_errors")["unknown_command_99"]
    assert CommandedFlight().ask_one(Port.HIGH_LEVEL, 0, b"\x63").hex() == answer
    assert bytes.fromhex(answer)[3] == errno.ENOEXEC


def test_external_poses():
    firmware = recorded("external_pose")
    flight = CommandedFlight(positioning="none")
    place = (0.5, -0.3, 0.0)
    left = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))

    def send(duration, channel, data):
        """Send a measurement at 50 Hz."""
        for _ in range(round(duration / 0.02)):
            flight.ask(Port.LOCALIZATION, channel, data)
            flight.run(0.02)

    send(3.0, 0, struct.pack("<3f", *place))
    assert flight.pose() == pytest.approx(firmware["after_extpos"], abs=0.1)
    send(3.0, 1, struct.pack("<B7f", 8, *place, *left))
    # The attitude is pulled to the initial one.
    assert flight.pose() == pytest.approx(firmware["after_extpose_yaw90"], abs=0.1)
    track = []
    for _ in range(4):
        for duration in (0.24, 0.26):
            send(duration, 1, struct.pack("<B7f", 8, 1.5, *place[1:], *left))
            track.append(flight.firmware.estimate.x)
    # To the estimate a jump is a velocity, too: it swings beyond.
    assert track == pytest.approx(firmware["x_after_1m_jump_each_0.25s"], abs=0.03)
    flight.run(2.0)
    assert flight.pose()[:3] == pytest.approx(firmware["2s_without"][:3], abs=0.03)
    assert flight.pose()[3] == pytest.approx(firmware["2s_without"][3], abs=1.0)
