"""Streamed setpoints: the recorded flights of the firmware, flown again."""

import math

import pytest
from flight_recorder import HEIGHT, PEAK, PWM, Flight, position
from recording import recorded
from virtual_bench import SETPOINTS_STOP, attitude, generic

from crazyflie_virtual.crtp import Port

HOVER = position(0.0, 0.0, 0.6)


def streamed(duration, height=0.6):
    """Return a flight that a stream holds at a height."""
    flight = Flight()
    flight.watch(duration, position(0.0, 0.0, height))
    return flight


def test_thrust_lock():
    firmware = recorded("thrust_lock")
    flight = Flight()
    thrust = attitude(thrust=20000)
    flight.watch(1.0, thrust)
    assert flight.highest == firmware["motors_max_before_zero"]
    flight.unlock()
    flight.begin()
    flight.watch(0.6, thrust)
    assert flight.highest == pytest.approx(firmware["motors_max_after_zero"], abs=PWM)
    flight.ask(*SETPOINTS_STOP)
    flight.begin()
    flight.watch(0.4, thrust)
    assert flight.highest == pytest.approx(firmware["motors_max_after_notify_no_zero"], abs=PWM)
    # The record does not say how it came to be on the ground: so it does not lock.
    flight.ask(*SETPOINTS_STOP)
    flight.run(2.5)
    assert hex(flight.bits) == firmware["bits_end"]
    flight.ask(Port.LINK, 1, b"\0")
    flight.begin()
    flight.watch(0.6, thrust)
    expected = firmware["motors_max_after_reconnect_no_zero"]
    assert flight.highest == pytest.approx(expected, abs=PWM)
    flight.begin()
    flight.ask(*attitude(thrust=900))
    flight.run(0.01)
    assert flight.most == firmware["motors_max_thrust_900"]
    flight.ask(*attitude(thrust=65535))
    flight.run(0.01)
    assert flight.firmware.stabilizer.thrust == firmware["thrust_log_at_65535"]


@pytest.mark.parametrize("name", ["stream_silence_0.3", "stream_silence_0.7", "stream_silence_2.5"])
def test_stream_silence(name):
    firmware = recorded(name)
    flight = streamed(3.5)
    assert flight.height == pytest.approx(firmware["z_before"], abs=HEIGHT)
    flight.begin()
    track = flight.watch(float(name.rpartition("_")[2]))
    track.check(firmware)
    assert flight.height == pytest.approx(firmware["z_after_silence"], abs=HEIGHT)
    flight.begin()
    track = flight.watch(1.5, HOVER)
    track.check_bits(firmware["bits_after_resume"])
    assert flight.height == pytest.approx(firmware["z_1.5s_after_resume"], abs=HEIGHT)
    assert flight.highest == pytest.approx(firmware["motors_after_resume_max"], abs=PEAK)


def test_cmd_vel_silence():
    firmware = recorded("cmd_vel_silence")
    flight = Flight()
    flight.watch(1.0, attitude(thrust=0))
    # "0.6 s" in the steps; by how fast it climbs then, the loop took longer.
    flight.watch(0.7, attitude(thrust=46000))
    flight.begin()
    track = flight.watch(3.0)
    track.check_heights([firmware["z_at_silence"]], [0.05])
    track.check(firmware)
    track.check_heights(firmware["track_z"], (0.5, 1.0, 2.0, 2.9))


def test_stream_land_silence_short():
    firmware = recorded("stream_land_silence_short")
    flight = streamed(3.0, 0.4)
    flight.watch(2.0, position(0.0, 0.0, 0.02))
    flight.watch(0.3, attitude(thrust=0))
    flight.begin()
    track = flight.watch(5.0)
    track.check_bits(firmware["bits"])
    assert hex(flight.bits) == firmware["bits_end"]
    flight.ask(*SETPOINTS_STOP)
    assert flight.up(0.4) == firmware["takeoff_errno"]
    flight.run(3.0)
    assert flight.height == firmware["z_after_takeoff"]


def test_stop_setpoint_in_flight():
    firmware = recorded("stop_setpoint_in_flight")
    flight = streamed(3.5, 0.5)
    flight.begin()
    flight.watch(0.3, generic(0, ""))
    track = flight.watch(4.0)
    track.check(firmware)
    assert hex(flight.bits) == firmware["bits_end"]


def test_notify_wait_then_land():
    firmware = recorded("notify_wait_then_land")
    flight = streamed(3.0)
    assert flight.height == pytest.approx(firmware["z_before"], abs=HEIGHT)
    track = flight.begin()
    flight.ask(*SETPOINTS_STOP)
    flight.watch(1.0)
    track.check_motors(firmware["motors_on_off"])
    track.check_heights([firmware["z_0.3s"], firmware["z_1s_after_notify"]], (0.3, 0.99))
    assert flight.land() == firmware["land_errno"]
    flight.watch(4.2)
    track.check_bits(firmware["bits"])
    assert flight.height == firmware["z_end"]
    assert hex(flight.bits) == firmware["bits_end"]


def test_notify_land_at_once():
    firmware = recorded("notify_land_at_once")
    flight = streamed(3.0)
    track = flight.begin()
    flight.ask(*SETPOINTS_STOP)
    assert flight.land() == firmware["land_errno"]
    flight.watch(4.5)
    track.check(firmware)
    track.check_heights(firmware["track_z"], (0.0, 0.5, 1.0, 1.5, 2.0, 2.5))


def test_land_without_notify():
    firmware = recorded("land_without_notify")
    flight = streamed(3.0)
    track = flight.begin(before_supervisor=0.03)
    assert flight.land() == firmware["land_errno"]
    flight.watch(4.0)
    track.check(firmware)
    track.check_heights(firmware["track_z"], (0.4, 1.0, 1.9, 2.2, 3.0, 4.0))
    assert hex(flight.bits) == firmware["bits_end"]


def test_one_setpoint_during_hl():
    firmware = recorded("one_setpoint_during_hl")
    flight = Flight()
    flight.up(0.6)
    flight.run(5.0)
    track = flight.begin(before_supervisor=0.03)
    flight.ask(*HOVER)
    flight.watch(4.0)
    track.check(firmware)
    track.check_heights(firmware["track_z"], (0.25, 1.0, 1.8, 2.7, 3.5))


def test_takeoff_after_stream_without_notify():
    firmware = recorded("takeoff_after_stream_without_notify")
    flight = Flight()
    flight.watch(0.5, attitude(thrust=0))
    track = flight.begin(before_supervisor=0.03)
    assert flight.up(0.5) == firmware["errno"]
    flight.watch(3.0)
    track.check_bits(firmware["bits"])
    assert flight.highest == firmware["motors_max"]
    assert flight.height == firmware["z_3s"]
    track = flight.begin(before_supervisor=0.03)
    flight.ask(*SETPOINTS_STOP)
    flight.watch(1.0)
    track.check_bits(firmware["bits_after_notify"])
    track.check_heights([firmware["z_1s_after_late_notify"]], [1.0])


def test_takeoff_after_stream_with_notify():
    firmware = recorded("takeoff_after_stream_with_notify")
    flight = Flight()
    flight.watch(0.5, attitude(thrust=0))
    flight.ask(*SETPOINTS_STOP)
    track = flight.begin(before_supervisor=0.002)
    assert flight.up(0.5) == firmware["errno"]
    flight.watch(3.5)
    track.check_bits(firmware["bits"])
    assert flight.height == pytest.approx(firmware["z"], abs=HEIGHT)


def test_setpoint_nan():
    firmware = recorded("setpoint_nan")
    flight = streamed(3.5)
    track = flight.begin()
    flight.watch(1.0, position(math.nan, 0.0, 0.6))
    flight.watch(2.0, HOVER)
    track.check(firmware)
    for time, x, y, z, _ in firmware["track"]:
        found = [track.coordinate(time, value, i) for i, value in enumerate((x, y, z))]
        assert found == pytest.approx([x, y, z], abs=0.1)
