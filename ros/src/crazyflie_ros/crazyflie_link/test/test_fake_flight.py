"""The stand-in for a flight does what the firmware was recorded to do."""

import json
import pathlib
import struct

import pytest

from crazyflie_link.testing.fake_flight import FakeFlight

RECORDED = json.loads(
    (
        pathlib.Path(__file__).parents[3] / "crazyflie_virtual/test/recorded/firmware_2026_08.json"
    ).read_text()
)["scenarios"]

LAG = 0.1
"""After a recorded moment, s: the firmware's supervisor runs at 25 Hz."""


def takeoff(duration=2.0, group=0):
    return struct.pack("<BBff?f", 7, group, 0.5, 0.0, True, duration)


def land(duration=2.0, group=0):
    return struct.pack("<BBff?f", 8, group, 0.0, 0.0, True, duration)


STOP = b"\x03\x00"


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
    return [
        (moment, int(bits, 16))
        for moment, bits in RECORDED[scenario]["firmware"][key]
        if moment < 7.0
    ]


def follow(flight, time, changes):
    """Compare the state after each recorded change."""
    begin = time.now
    for moment, bits in changes:
        time.now = begin + moment + LAG
        assert int(flight.state) == bits, f"{moment} s"


def test_takeoff_and_landing(flight, time):
    assert int(flight.state) == 0x20E
    assert flight.command(takeoff()) == 0
    follow(flight, time, flown("takeoff_land", "bits_up")[1:])
    assert flight.command(land()) == 0
    follow(flight, time, flown("takeoff_land", "bits_down"))
    assert flight.starts == 1


def test_repeated_commands(flight, time):
    recorded = RECORDED["takeoff_twice_land_twice"]["firmware"]
    flight.command(takeoff())
    time.now += 3.0
    assert flight.command(takeoff()) == recorded["takeoff_while_flying_errno"] == 1
    assert flight.command(land()) == recorded["land1"]
    time.now += 0.2
    assert flight.command(land()) == recorded["land2"] == 1
    time.now += 3.0
    assert not flight.motors_run
    assert flight.command(land()) == recorded["land_on_ground_errno"] == 0
    assert recorded["land_on_ground_motors_max"] > 0
    assert flight.motors_run
    assert flight.starts == 2


def test_stop_in_flight(flight, time):
    flight.command(takeoff())
    time.now += 3.0
    assert flight.command(STOP) == 0
    assert not flight.motors_run
    follow(flight, time, flown("hl_stop_in_flight", "bits"))


def test_streams(flight, time):
    flight.stream(True)
    assert int(flight.state) == int(RECORDED["notify_land_at_once"]["firmware"]["bits"][0][1], 16)
    flight.end_stream()
    assert not flight.motors_run
    flight.stream(True)
    flight.end_stream()
    flight.command(land())
    time.now += LAG
    assert flight.motors_run
    assert int(flight.state) == int(RECORDED["notify_land_at_once"]["firmware"]["bits"][1][1], 16)


def test_a_stream_keeps_the_planner_out(flight):
    flight.stream(False)
    assert flight.command(takeoff()) == 0
    assert not flight.motors_run
    flight.end_stream()
    assert flight.motors_run


def test_groups(flight):
    assert flight.command(takeoff(group=4)) == 0
    assert not flight.motors_run
    flight.command(b"\x00\x04")
    assert flight.command(takeoff(group=6)) == 0
    assert flight.motors_run
    assert flight.command(land(group=3)) == 0
    assert flight.command(land(group=0)) == 0


def test_an_emergency_locks(flight):
    flight.command(takeoff())
    flight.lock()
    recorded = RECORDED["emergency_stop"]["firmware"]
    assert int(flight.state) & 0x5F == int(recorded["bits_end"], 16) & 0x5F
    assert flight.command(takeoff()) == recorded["takeoff_errno"]
    assert flight.command(STOP) == recorded["stop_errno"]
    flight.restart()
    assert flight.command(takeoff()) == 0


def test_older_firmware_does_not_report_its_planner(time):
    flight = FakeFlight(protocol=7, clock=time)
    flight.command(takeoff())
    assert int(flight.state) == 0x1E
