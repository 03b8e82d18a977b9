"""Setpoints: what cflib sends against what the firmware understands."""

import math
import struct

import pytest
from virtual_bench import Bench, attitude, cflib_client, generic

from crazyflie_virtual.crtp import Port
from crazyflie_virtual.firmware.setpoints import decode_generic
from crazyflie_virtual.firmware.states import ABSOLUTE, DISABLED, VELOCITY


def sent_by_cflib(method, *arguments, protocol=12):
    """Return the one packet that a method of cflib's commander sends."""
    client, sent = cflib_client(protocol)
    getattr(client.commander, method)(*arguments)
    (packet,) = sent
    return packet


def decoded(method, *arguments, protocol=12):
    packet = sent_by_cflib(method, *arguments, protocol=protocol)
    assert (packet.port, packet.channel) == (Port.GENERIC_SETPOINT, 0)
    return decode_generic(packet.data, 3.0)


def modes(setpoint):
    return (setpoint.mode.x, setpoint.mode.y, setpoint.mode.z, setpoint.mode.yaw)


def test_attitude_signs_on_the_wire():
    packet = sent_by_cflib("send_setpoint", 5.0, 10.0, 20.0, 40000)
    # cflib turns the pitch round.
    assert packet.data == struct.pack("<fffH", 5.0, -10.0, 20.0, 40000)
    bench = Bench()
    bench.unlock()
    bench.ask(packet.port, packet.channel, packet.data)
    setpoint = bench.firmware.commander.setpoint
    assert (setpoint.roll, setpoint.pitch) == (5.0, -10.0)
    # The firmware turns the yaw rate round.
    assert setpoint.yaw_rate == -20.0
    assert setpoint.thrust == 40000.0
    assert modes(setpoint) == (DISABLED, DISABLED, DISABLED, VELOCITY)


@pytest.mark.parametrize(("thrust", "expected"), [(999, 0), (1000, 1000), (65535, 60000)])
def test_thrust_is_limited(thrust, expected):
    bench = Bench()
    bench.unlock()
    bench.ask(*attitude(thrust=thrust))
    assert bench.firmware.commander.setpoint.thrust == expected


def test_rate_mode_of_attitude_setpoints():
    bench = Bench()
    bench.firmware.attitude_decoder.roll_mode = 0
    bench.ask(*attitude(roll=30.0, pitch=5.0))
    setpoint = bench.firmware.commander.setpoint
    assert (setpoint.mode.roll, setpoint.roll_rate, setpoint.roll) == (VELOCITY, 30.0, 0.0)
    assert (setpoint.mode.pitch, setpoint.pitch) == (ABSOLUTE, 5.0)


@pytest.mark.filterwarnings("ignore:Using legacy:DeprecationWarning")
@pytest.mark.parametrize("protocol", [8, 12])
@pytest.mark.parametrize(
    ("method", "fields", "expected"),
    [
        ("velocity_world", ("vx", "vy", "vz", "yaw_rate"), (VELOCITY,) * 4),
        (
            "zdistance",
            ("roll", "pitch", "yaw_rate", "z"),
            (DISABLED, DISABLED, ABSOLUTE, VELOCITY),
        ),
        ("hover", ("vx", "vy", "yaw_rate", "z"), (VELOCITY, VELOCITY, ABSOLUTE, VELOCITY)),
        ("position", ("x", "y", "z", "yaw"), (ABSOLUTE,) * 4),
    ],
)
def test_four_numbers(method, fields, expected, protocol):
    numbers = (0.5, -0.25, 30.0, 0.75)
    setpoint = decoded(f"send_{method}_setpoint", *numbers, protocol=protocol)
    assert modes(setpoint) == expected
    assert tuple(getattr(setpoint, field) for field in fields) == numbers
    assert setpoint.velocity_body == (method == "hover")
    assert setpoint.time == 3.0


def test_full_state_rates_are_milliradians():
    quaternion = [0.0, 0.0, math.sin(0.25), math.cos(0.25)]
    setpoint = decoded(
        "send_full_state_setpoint", [1, 2, 3], [4, 5, 6], [7, 8, 9], quaternion, 0.1, 0.2, 0.3
    )
    assert (setpoint.x, setpoint.vy, setpoint.az) == (1.0, 5.0, 9.0)
    assert setpoint.quaternion == pytest.approx(quaternion, abs=2e-3)
    rates = (setpoint.roll_rate, setpoint.pitch_rate, setpoint.yaw_rate)
    assert rates == pytest.approx([math.degrees(rate) for rate in (0.1, 0.2, 0.3)], abs=0.1)
    assert (*modes(setpoint), setpoint.mode.quaternion) == (1, 1, 1, 0, 1)


@pytest.mark.parametrize("is_rate", [False, True])
def test_manual(is_rate):
    setpoint = decoded("send_setpoint_manual", 3.0, 4.0, 5.0, 50.0, is_rate)
    tilt = (setpoint.roll_rate, setpoint.pitch_rate) if is_rate else (setpoint.roll, setpoint.pitch)
    assert tilt == (3.0, -4.0)
    assert setpoint.mode.roll == (VELOCITY if is_rate else ABSOLUTE)
    assert (setpoint.yaw_rate, setpoint.thrust) == (5.0, 35000.0)


def test_stop_is_nothing_at_all():
    setpoint = decoded("send_stop_setpoint")
    assert setpoint.mode == (DISABLED,) * 7
    assert setpoint.thrust == 0.0


@pytest.mark.parametrize(
    "packet",
    [
        generic(3, "ffff", 1.0, 2.0, 3.0, 0.0),
        generic(99, ""),
        (Port.GENERIC_SETPOINT, 0, b""),
        (Port.SETPOINT, 0, b"\x00"),
    ],
)
def test_what_is_no_setpoint_changes_nothing(packet):
    bench = Bench()
    before = bench.firmware.commander.setpoint
    assert bench.ask(*packet) == []
    assert bench.firmware.commander.setpoint is before


@pytest.mark.parametrize("goal", [(0.5, 0.0), (0.5, 0.5), (1.0, -1.0), (-0.3, 0.3)])
def test_a_position_aside_lifts_a_vehicle_that_stands(goal):
    """Roll and pitch together: the rotors tip the body on its feet until it has its attitude.

    A ground that held it level would let the firmware's integrators wind up on both axes, whose sum
    the mixer takes from the thrust of all motors: the vehicle would stand there for ever.
    """
    bench = Bench()
    bench.stream(generic(7, "ffff", *goal, 0.7, 0.0), 5.0)
    assert bench.physics.position == pytest.approx((*goal, 0.7), abs=0.12)


def test_a_position_with_another_heading_does_not_lift_a_vehicle_that_stands():
    """As recorded of the firmware: the feet hold the heading, the rate loop winds up."""
    bench = Bench()
    bench.stream(generic(7, "ffff", 0.0, 0.0, 0.5, 30.0), 4.0)
    assert bench.height == 0.0
