"""A first flight on a virtual vehicle: it passes, and each fault stops it at its step by name."""

import math
import re
import time
from pathlib import Path

import pytest
from first_flight_rig import FastRig
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from crazyflie_examples.first_flight import STEPS, fly, report
from crazyflie_examples.first_flight_program import FirstFlightParameters, LiveRig, main

NAMES = [step.name for step in STEPS]


def yes(_):
    return True


def swapped(position, yaw):
    x, y, z = position
    return (y, x, z), yaw


def scaled(position, yaw):
    return tuple(1.1 * part for part in position), yaw


def turned(position, yaw):
    return position, yaw + math.pi / 2.0


def flown(ask=yes, **faults):
    return list(fly(FastRig(**faults), ask))


def test_a_good_vehicle_passes():
    verdicts = flown()
    assert [(each.step, each.passed) for each in verdicts] == [(name, True) for name in NAMES], (
        verdicts[-1]
    )


@pytest.mark.parametrize(
    ("faults", "step", "words"),
    [
        ({"measure": swapped}, "poses by hand", "axes are swapped: forward by hand is left"),
        # The axes and the mass show that a fault before and one in flight is found; the others are
        # further ones.
        ({"measure": scaled}, "poses by hand", "the scale is wrong: 1 m by hand are 1.10, 1.10, 1"),
        ({"measure": turned}, "poses by hand", "the yaw is off by 90 degrees"),
        ({"delay": 0.12}, "poses by hand", "poses are delayed: 1[12]"),
        ({"weak": 2}, "hover by the driver", "motor 2 is commanded"),
        ({"mass_error": 45.0 / 33.0 - 1.0}, "hover by the driver", "the mass is off"),
        ({"battery": 0.0385}, "doctor", "V without load; normal is 3.7"),
    ],
)
def test_a_fault_stops_it_at_its_step(faults, step, words):
    *before, last = flown(**faults)
    assert all(each.passed for each in before)
    assert (last.step, last.passed) == (step, False)
    assert re.search(words, last.text)
    assert len(before) == NAMES.index(step)


def test_an_invalid_address_is_named(capsys):
    assert main(["radio:80"]) == 1
    assert "radio:80" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["udp://127.0.0.1:9", "--positioning", "gps"])
    assert "expected one of mocap, lighthouse, flow, loco" in capsys.readouterr().err


def test_the_pilot_ends_it():
    verdicts = flown(ask=lambda text: not text.startswith("motors"))
    assert [(each.step, each.passed) for each in verdicts] == [("doctor", True), ("motors", False)]
    assert verdicts[-1].text == "ended by the pilot"


def test_a_motor_that_turns_the_wrong_way():
    *_, last = flown(ask=lambda text: "motor 3" not in text)
    assert "motor 3 does not turn counter-clockwise" in last.text


def test_the_report_has_a_verdict_for_each_step_and_the_bag():
    verdicts = flown(measure=swapped)
    page = report(verdicts, "First flight of <cf1>", "/tmp/flight.bag")
    assert "First flight of &lt;cf1&gt;" in page and "/tmp/flight.bag" in page
    assert page.count("<tr>") == len(STEPS)
    assert page.count("passed") == 2 and page.count("FAILED") == 1
    assert page.count("not done") == len(STEPS) - 3


def test_a_flight_that_is_interrupted_without_poses_has_them_for_its_landing(monkeypatch):
    options = FirstFlightParameters(mocap_frame="vehicle")
    rig = LiveRig("radio://0/80/2M/E7E7E7E7E7", options, Path())
    seen = []
    monkeypatch.setattr(rig, "_on_pose", seen.append)
    pose = TransformStamped(child_frame_id="vehicle")

    def interrupt(_):
        rig._on_tf(TFMessage([pose]))
        raise KeyboardInterrupt

    monkeypatch.setattr(time, "sleep", interrupt)
    with pytest.raises(KeyboardInterrupt):
        rig.hide_poses(0.4)
    assert seen == []
    rig._on_tf(TFMessage([pose]))
    assert seen == [pose]
