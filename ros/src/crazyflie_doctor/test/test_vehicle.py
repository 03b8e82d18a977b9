"""A vehicle on the ground: what is normal, and what each fault is called."""

import dataclasses
import math

import pytest
from test_program import run_doctor

from crazyflie_doctor.finding import lines
from crazyflie_doctor.vehicle import ALL_MOTORS, VehicleFacts, checks, examine
from crazyflie_model.supervisor import SupervisorState
from crazyflie_virtual.testing import virtual_vehicle

GOOD = VehicleFacts(
    voltage=4.05,
    quality=1.0,
    latency=0.004,
    decks=("bcFlow2",),
    firmware="2026.08",
    estimator=2,
    deviations=(0.01, 0.01, 0.01),
    changes=(0.0, 0.0, 0.0),
    motors=ALL_MOTORS,
    battery_passed=True,
)


def said(facts):
    return [line for check in checks(facts) for line in lines(check)]


def test_nothing_is_wrong_with_a_good_vehicle():
    assert {level for level, _ in said(GOOD)} == {"ok"}


@pytest.mark.parametrize(
    ("changes", "level", "words"),
    [
        ({"voltage": 3.3}, "error", "3.30 V without load; normal is 3.7 to 4.25 V"),
        ({"voltage": math.nan}, "error", "nan V"),
        ({"quality": 0.8}, "error", "80 % of pings answered; normal is 95 % or more"),
        ({"latency": 0.05}, "warn", "latency 50.0 ms; normal is 20 ms or less"),
        ({"firmware": "2019.09"}, "warn", "release 2019.09; flown against 2026.08"),
        ({"deviations": (0.0, 2.0, 0.0)}, "error", "deviation of 2.00 m/s at rest"),
        ({"changes": (0.0, 0.5, 0.0)}, "error", "has changed by 0.50 m/s"),
        ({"deviations": (), "changes": ()}, "warn", "its variance is not logged"),
        ({"state": SupervisorState.of(deck_fault=True)}, "error", "cannot fly: deck fault"),
        ({"state": SupervisorState.of(locked=True)}, "error", "the vehicle cannot fly: locked"),
        ({"estimator": 1}, "error", "the complementary filter estimates, which ignores poses"),
        ({"motors": 0b1011}, "error", "motor 3 fails its self test"),
        ({"battery_passed": False}, "error", "its voltage sags too far"),
        ({"failure": "the radio gets no answer"}, "error", "the radio gets no answer"),
    ],
)
def test_each_fault_has_its_range_and_what_to_do(changes, level, words):
    bad = [
        (found, line) for found, line in said(dataclasses.replace(GOOD, **changes)) if found != "ok"
    ]
    assert [found for found, _ in bad] == [level]
    assert words in bad[0][1]
    assert "; " in bad[0][1].split(words)[1]


def test_a_virtual_vehicle_is_examined():
    with virtual_vehicle(positioning="flow", motor_failure=2) as (_, uri):
        facts = examine(uri, duration=2.0, motors=True)
    assert facts.failure == ""
    assert 4.0 < facts.voltage < 4.25
    assert facts.quality > 0.95
    assert "bcFlow2" in facts.decks and "bcLighthouse4" not in facts.decks
    assert facts.firmware.startswith("2026.08")
    assert facts.estimator == 2
    assert facts.state is not None and SupervisorState.CAN_FLY in facts.state
    assert all(0.0 < each < 0.1 for each in facts.deviations)
    assert facts.motors == 0b1101
    assert facts.battery_passed is True


def test_a_vehicle_that_is_not_there_is_an_error():
    status, out, _ = run_doctor("--vehicle", "udp://127.0.0.1:9")
    assert status == 1
    assert "error  vehicle: " in out and "nothing listens" in out
