"""A vehicle without dynamics reports what the firmware was recorded to do, and can be frozen."""

import socket
import struct
import threading

import pytest
from recording import recorded

from crazyflie_virtual import ports
from crazyflie_virtual.testing import FakeFlight, FakeVehicle

LAG = 0.1  #: After a recorded moment, s: the firmware's supervisor runs at 25 Hz.


def takeoff(duration=2.0, group=0):
    return struct.pack("<BBff?f", 7, group, 0.5, 0.0, True, duration)


def land(duration=2.0, group=0):
    return struct.pack("<BBff?f", 8, group, 0.0, 0.0, True, duration)


STOP = b"\x03\x00"
PING = bytes([0xFC])
POSITION = bytes([0x7C, 7]) + bytes(16)


def command(flight, data):
    """Execute a command; return the error number."""
    flight.update()
    return ports.handle_high_level(flight, 0, data)[3]


def stream(flight, data):
    flight.update()
    ports.handle_generic(flight, 0, data)


def end_stream(flight):
    flight.update()
    ports.handle_generic(flight, 1, b"\0")


FLOWN, OFF = POSITION[1:], b"\0"


class Time:
    """A clock that is set by hand."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def time():
    return Time()


@pytest.fixture
def flight(time):
    return FakeFlight(clock=time)


def flown(scenario, key):
    """Return (time in s, bits) of the state's recorded changes, up to the rearming."""
    return [(moment, int(bits, 16)) for moment, bits in recorded(scenario)[key] if moment < 7.0]


def follow(flight, time, changes):
    """Compare the state after each recorded change."""
    begin = time.now
    for moment, bits in changes:
        time.now = begin + moment + LAG
        assert int(flight.state) == bits, f"{moment} s"


def test_takeoff_and_landing(flight, time):
    assert int(flight.state) == 0x20E
    assert command(flight, takeoff()) == 0
    follow(flight, time, flown("takeoff_land", "bits_up")[1:])
    assert command(flight, land()) == 0
    follow(flight, time, flown("takeoff_land", "bits_down"))
    assert flight.starts == 1


def test_repeated_commands(flight, time):
    seen = recorded("takeoff_twice_land_twice")
    command(flight, takeoff())
    time.now += 3.0
    assert command(flight, takeoff()) == seen["takeoff_while_flying_errno"] == 1
    assert command(flight, land()) == seen["land1"]
    time.now += 0.2
    assert command(flight, land()) == seen["land2"] == 1
    time.now += 3.0
    assert not flight.motors_run
    assert command(flight, land()) == seen["land_on_ground_errno"] == 0
    assert seen["land_on_ground_motors_max"] > 0
    assert flight.motors_run
    assert flight.starts == 2


def test_stop_in_flight(flight, time):
    command(flight, takeoff())
    time.now += 3.0
    assert command(flight, STOP) == 0
    assert not flight.motors_run
    follow(flight, time, flown("hl_stop_in_flight", "bits"))


def test_streams(flight, time):
    stream(flight, FLOWN)
    assert int(flight.state) == int(recorded("notify_land_at_once")["bits"][0][1], 16)
    end_stream(flight)
    assert not flight.motors_run
    stream(flight, FLOWN)
    end_stream(flight)
    command(flight, land())
    time.now += LAG
    assert flight.motors_run
    assert int(flight.state) == int(recorded("notify_land_at_once")["bits"][1][1], 16)


def test_a_stream_keeps_the_planner_out(flight):
    stream(flight, OFF)
    assert command(flight, takeoff()) == 0
    assert not flight.motors_run
    end_stream(flight)
    assert flight.motors_run


def test_groups(flight):
    assert command(flight, takeoff(group=4)) == 0
    assert not flight.motors_run
    command(flight, b"\x00\x04")
    assert command(flight, takeoff(group=6)) == 0
    assert flight.motors_run
    assert command(flight, land(group=3)) == 0
    assert command(flight, land(group=0)) == 0


def test_an_emergency_locks(flight):
    command(flight, takeoff())
    flight.lock()
    seen = recorded("emergency_stop")
    assert int(flight.state) & 0x5F == int(seen["bits_end"], 16) & 0x5F
    assert command(flight, takeoff()) == seen["takeoff_errno"]
    assert command(flight, STOP) == seen["stop_errno"]
    flight.restart()
    assert command(flight, takeoff()) == 0


def test_older_firmware_does_not_report_its_planner(time):
    flight = FakeFlight(protocol=7, clock=time)
    command(flight, takeoff())
    assert int(flight.state) == 0x1E


def test_what_is_sent_to_a_frozen_vehicle_is_lost_also_if_its_thread_is_late():
    goes_on = threading.Event()
    with FakeVehicle() as vehicle, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        vehicle.lose = lambda _: goes_on.wait()
        sender.sendto(PING, ("127.0.0.1", vehicle.port))
        vehicle.wait_for_packets(15, 0)
        vehicle.is_frozen = True
        sender.sendto(POSITION, ("127.0.0.1", vehicle.port))
        threading.Timer(0.1, goes_on.set).start()
        vehicle.is_frozen = False
        vehicle.lose = lambda _: False
        sender.sendto(PING, ("127.0.0.1", vehicle.port))
        vehicle.wait_for_packets(15, 0, 2)
        assert vehicle.received == [(15, 0, b""), (15, 0, b"")]
        assert vehicle.broadcasts == []


def test_a_flight_that_restarts_while_commands_come_can_fly():
    flight, is_over = FakeFlight(), threading.Event()

    def answer():
        while not is_over.is_set():
            flight.update()

    thread = threading.Thread(target=answer)
    thread.start()
    try:
        for _ in range(200):
            flight.update()
            flight.restart()
            assert command(flight, takeoff()) == 0
    finally:
        is_over.set()
        thread.join()
