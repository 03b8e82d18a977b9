"""Floods and a frozen listener do not slow the control of a flying vehicle down."""

import contextlib
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from crazyflie_reports.flight_operator import ready_operator

FLOOD = (sys.executable, "-m", "crazyflie_utils.testing.hostile_publisher")
FREEZE = Path(__file__).with_name("frozen_listener.py")
HOVER = "{state: {z: 1.0}}"
ATTACKS = {
    "junk": (
        *FLOOD,
        "/in_flight_flight_status",
        "crazyflie_msgs/FlightStatus",
        "10000",
        "{state: 3}",
    ),
    "reference": (*FLOOD, "/ref", "crazyflie_msgs/PositionVelocityStateStamped", "10000", HOVER),
    "transforms": (*FLOOD, "/tf", "tf2_msgs/TFMessage", "2500", "80"),
    "frozen": (sys.executable, str(FREEZE)),
}
DURATION = 1.5
ENOUGH = 0.95
"""Of the controls of undisturbed flight."""

TRIES = 3
"""Other work of the machine comes and goes; an attack that does harm does it always."""


class Attacker:
    """A process that leaves others the processor: it is about what it sends."""

    def __init__(self, kind):
        self._process = subprocess.Popen(
            ("nice", *ATTACKS[kind]), stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def begin(self):
        self._process.stdin.write(b"begin\n")
        self._process.stdin.flush()

    def state(self):
        """Return the letter for what it does; T is frozen."""
        stat = Path(f"/proc/{self._process.pid}/stat").read_text(encoding="utf-8")
        return stat.rpartition(")")[2].split()[0]

    def end(self):
        """Return the number of its listeners, and of the messages a second for each."""
        self._process.send_signal(signal.SIGCONT)
        return [int(word) for word in self._process.communicate(b"end\n", timeout=120.0)[0].split()]

    def kill(self):
        self._process.kill()
        self._process.wait(30.0)


@contextlib.contextmanager
def attackers():
    """Wait until all of them are ready, which takes a while."""
    ready = {}
    try:
        for kind in ATTACKS:
            ready[kind] = Attacker(kind)
        yield ready
    finally:
        for attacker in ready.values():
            attacker.kill()


@pytest.fixture(scope="module")
def flight():
    """Fly; return the record, controls per second in each part, and what attackers sent."""
    rates, floods = {}, {}
    with attackers() as ready, ready_operator() as operator:
        operator.takeoff()
        record = operator.record

        def measure():
            start = record.state.last_time
            operator.hover(DURATION)
            end = record.state.last_time
            return len(record.final_control.between(start, end)) / (end - start)

        before = measure()
        for kind, attacker in ready.items():
            attacker.begin()
            operator.hover(0.5)
            for _ in range(TRIES):
                rates[kind] = measure()
                if rates[kind] > ENOUGH * before:
                    break
            floods[kind] = attacker.state()
            floods[kind] = attacker.end() or floods[kind]
        rates["undisturbed"] = (before + measure()) / 2.0
        operator.land()
        return operator.finish(), rates, floods


@pytest.mark.parametrize("kind", ATTACKS)
def test_control_goes_on(flight, kind):
    _, rates, _ = flight
    assert rates[kind] > ENOUGH * rates["undisturbed"]


@pytest.mark.parametrize(
    ("kind", "rate"), [("junk", 5000), ("reference", 5000), ("transforms", 1000)]
)
def test_it_was_a_flood(flight, kind, rate):
    _, _, floods = flight
    listeners, sent = floods[kind]
    assert listeners > 0
    assert sent > rate


def test_it_was_frozen(flight):
    assert flight[2]["frozen"] == "T"


def test_vehicle_stays_where_it_was(flight):
    record, _, _ = flight
    heights = record.state.between(record.events["flying"], record.events["land"])[:, 2]
    assert heights.min() > 0.8
    assert heights.max() < 1.2
