"""A flight from which disk, master, controller and finally everything is taken away."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

_SCRIPT = Path(__file__).parent / "faulty_flight.py"


@pytest.fixture(scope="module")
def seen():
    """Fly once, and return what was seen."""
    flight = subprocess.run(
        [sys.executable, _SCRIPT], capture_output=True, text=True, timeout=600, check=False
    )
    assert flight.returncode == 0, flight.stderr[-5000:]
    return json.loads(flight.stdout)


def test_flies_on_when_the_disk_is_full(seen):
    # The limit of a file's size is what a process sees of a full disk.
    assert seen["heights with a full disk"] == pytest.approx([1.0, 1.0], abs=0.05)


def test_flies_on_without_a_master(seen):
    assert seen["heights without a master"] == pytest.approx([1.0, 1.0], abs=0.05)


def test_sinks_softly_when_the_controller_is_frozen(seen):
    assert seen["fastest descent without a controller"] < 1.2


def test_stays_on_the_ground_when_the_controller_comes_back(seen):
    assert seen["heights after it has come back"] == pytest.approx([0.0, 0.0], abs=0.01)


def test_second_takeoff_does_not_overshoot(seen):
    assert seen["heights of the second takeoff"][1] < 1.1


def test_lands_at_ctrl_c(seen):
    assert seen["status of roslaunch"] == 0
    assert seen["height after Ctrl-C"] < 0.01
    assert seen["fastest descent after Ctrl-C"] < 0.6
    assert seen["last thrust"] == 0.0
