"""Floods and a frozen listener do not slow the control of a flying vehicle down."""

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import rospkg

from crazyflie_dev.flight_operator import ready_operator

FLOOD = (sys.executable, "-m", "crazyflie_utils.testing.hostile_publisher")
FREEZE = Path(rospkg.RosPack().get_path("crazyflie_examples")) / "bench" / "hostile.py"
HOVER = "{state: {z: 1.0}}"
ATTACKS = {
    "junk": (*FLOOD, "/in_flight_state", "std_msgs/String", "10000"),
    "reference": (*FLOOD, "/ref", "crazyflie_msgs/PositionVelocityStateStamped", "10000", HOVER),
    "transforms": (*FLOOD, "/tf", "tf2_msgs/TFMessage", "2500", "80"),
    "frozen": (sys.executable, str(FREEZE), "freeze"),
}
DURATION = 1.5
ENOUGH = 0.95
"""Of the controls of undisturbed flight."""


@contextlib.contextmanager
def attack(kind):
    """Attack in a process that leaves others the processor: it is about what it sends."""
    attacker = subprocess.Popen(
        ATTACKS[kind],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        preexec_fn=lambda: os.nice(10),
    )
    sent = []
    try:
        assert attacker.stdout.readline().split() in ([b"flooding"], [b"frozen"])
        yield sent
        attacker.send_signal(signal.SIGCONT)
        sent.extend(map(int, attacker.communicate(b"end\n", timeout=10.0)[0].split()))
    finally:
        attacker.kill()
        attacker.wait(10.0)



@pytest.fixture(scope="module")
def flight():
    """Fly; return the record, controls per second in each part, and what attackers sent."""
    rates, floods = {}, {}
    with ready_operator() as operator:
        operator.takeoff()
        record = operator._recorder.record

        def measure():
            start = record.state.last_time
            operator.hover(DURATION)
            end = record.state.last_time
            return len(record.final_control.between(start, end)) / (end - start)

        before = measure()
        for kind in ATTACKS:
            with attack(kind) as floods[kind]:
                operator.hover(0.5)
                rates[kind] = measure()
        rates["undisturbed"] = (before + measure()) / 2.0
        operator.land()
        return operator.finish(), rates, floods


@pytest.mark.parametrize("kind", ATTACKS)
def test_control_goes_on(flight, kind):
    _, rates, floods = flight
    print(rates, floods)
    assert rates[kind] > ENOUGH * rates["undisturbed"]


@pytest.mark.parametrize(("kind", "rate"), [("junk", 5000), ("reference", 5000), ("transforms", 1000)])
def test_it_was_a_flood(flight, kind, rate):
    _, _, floods = flight
    listeners, sent = floods[kind]
    assert listeners > 0
    assert sent > rate


def test_vehicle_stays_where_it_was(flight):
    record, _, _ = flight
    heights = record.state.between(record.events["flying"], record.events["land"])[:, 2]
    assert heights.min() > 0.8
    assert heights.max() < 1.2
