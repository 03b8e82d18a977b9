"""A first flight on a virtual vehicle: it passes, and each fault stops it at its step by name."""

import math
import os
import pty
import re
import signal
import sys
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace

import pytest
import rospkg
from first_flight_rig import FastRig
from genpy import Time
from geometry_msgs.msg import Quaternion, Transform, TransformStamped
from std_msgs.msg import Header
from std_srvs.srv import Empty, EmptyRequest, SetBool, SetBoolRequest, SetBoolResponse
from tf2_msgs.msg import TFMessage

from crazyflie_driver.msg import GenericLogData
from crazyflie_examples.first_flight import HEIGHT, STEP, STEPS, Stop, fly, report
from crazyflie_examples.first_flight_program import FirstFlightParameters, LiveRig, main
from crazyflie_model.units import GRAVITY
from crazyflie_msgs.msg import FilterStatus
from crazyflie_utils.parameters.vehicle_model import load
from crazyflie_utils.testing.launch_files import expand

LAUNCH = Path(rospkg.RosPack().get_path("crazyflie_examples")) / "launch"
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


@pytest.mark.parametrize(
    ("settings", "hover_pwm"),
    [
        ({}, 42000.0),
        # An ordinary vehicle hovers at the firmware's base, 36,000.
        ({"thrust_error": 42.0 / 36.0 - 1.0}, 36000.0),
        ({"model": "brushless", "auto_arm": False}, 31600.0),
    ],
)
def test_a_good_vehicle_passes(settings, hover_pwm):
    rig = FastRig(**settings)
    verdicts = list(fly(rig, yes))
    assert [(each.step, each.passed) for each in verdicts] == [(name, True) for name in NAMES], (
        verdicts[-1]
    )
    # What the driver's hover took is what the converter sends for g.
    assert load(str(rig.model_file)).pwm(GRAVITY) == pytest.approx(hover_pwm, rel=0.03)
    assert str(rig.model_file) in verdicts[NAMES.index("hover by the driver")].text
    assert max(sample.z for sample in rig.samples[rig.lqr_begin :]) < HEIGHT + STEP + 0.15


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
        ({"model": "brushless", "taken_for": "cf21"}, "hover by the driver", "choose its --model"),
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


class Live:
    """A `LiveRig` in flight by motion capture, with a clock moved by hand and a terminal."""

    def __init__(self, monkeypatch):
        options = FirstFlightParameters(mocap_frame="vehicle")
        self.rig = LiveRig("radio://0/80/2M/E7E7E7E7E7", options, Path())
        self.now, self.published = 100.0, []
        publisher = SimpleNamespace(publish=self.published.append)
        self.rig._handle = SimpleNamespace(time=lambda: self.now, call_service=lambda *_: Future())
        self.rig._tf = self.rig._external = publisher
        self.rig._landing = lambda: None
        self._keys, terminal = pty.openpty()
        monkeypatch.setattr(sys, "stdin", os.fdopen(terminal))
        self.log()
        self.pose()

    def log(self):
        """Receive a log of the vehicle."""
        self.rig._on_log(GenericLogData(values=[0.0] * 6))

    def pose(self, stamp=None):
        """Receive a pose."""
        header = Header(stamp=Time.from_sec(self.now if stamp is None else stamp))
        attitude = Transform(rotation=Quaternion(w=1.0))
        pose = TransformStamped(header, "vehicle", attitude)
        self.rig._on_tf(TFMessage([pose]))

    def type(self, text):
        """Type a text."""
        os.write(self._keys, text)


@pytest.fixture
def live(monkeypatch):
    return Live(monkeypatch)


def test_a_key_ends_a_call(live):
    live.type(b"x\n")
    with pytest.raises(Stop, match="ended by the pilot"):
        live.rig._call("/takeoff", Empty, EmptyRequest())


def test_an_answer_that_refuses_ends_it(live):
    refused = Future()
    refused.set_result(SetBoolResponse(False, "cf1 is not armed: setpoints come"))
    live.rig._handle.call_service = lambda *_: refused
    with pytest.raises(Stop, match="/crazyflie/arm: cf1 is not armed: setpoints come"):
        live.rig._call("arm", SetBool, SetBoolRequest(True))


def test_a_takeoff_waits_for_the_controller(live, monkeypatch):
    called = []

    def check():
        called.append("check")
        live.rig._on_filter_status(FilterStatus(has_controller=True))

    monkeypatch.setattr(live.rig, "_launch", lambda *_: called.append("launch"))
    monkeypatch.setattr(live.rig, "_call", lambda name, *_: called.append(name))
    monkeypatch.setattr(live.rig, "_check", check)
    live.rig.take_off()
    assert called == ["launch", "check", "/takeoff"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_flight_and_then_its_landing(live, number):
    live.rig.note(number)
    with pytest.raises(Stop, match=f"ended by {number.name}"):
        live.rig.run(60.0)
    live.rig.note(number)
    with pytest.raises(Stop, match=f"ended by {number.name}"):
        live.rig.land()


def test_a_key_ends_no_landing(live):
    live.type(b"x\n")
    answer = Future()
    answer.set_result(None)
    live.rig._handle.call_service = lambda *_: answer
    live.rig.land()


@pytest.mark.parametrize(("silent", "words"), [("pose", "no pose in"), ("log", "no log of")])
def test_silence_ends_a_flight_also_while_a_person_is_asked(live, silent, words):
    live.now += 1.5
    live.log() if silent == "pose" else live.pose()
    for act in (lambda: live.rig.run(60.0), lambda: live.rig.ask("go on?")):
        with pytest.raises(Stop, match=f"{words} .* has come for 1 s in flight"):
            act()


def test_a_person_answers_in_flight(live):
    live.type(b"\nno\n")
    assert live.rig.ask("go on?")
    assert not live.rig.ask("go on?")


def test_speeds_are_by_the_stamps_of_the_poses(live):
    # All arrive at once, one of them twice.
    for stamp in (100.01, 100.02, 100.02, 100.03):
        live.pose(stamp)
    assert [sample.time for sample in live.rig.samples] == pytest.approx(
        [100.0, 100.01, 100.02, 100.03]
    )


def test_a_flight_that_is_ended_without_poses_has_them_for_its_landing(live):
    def press(duration):
        live.pose()
        live.type(b"x\n")

    live.published.clear()
    live.rig._check = lambda: press(0.4)
    with pytest.raises(Stop, match="ended by the pilot"):
        live.rig.hide_poses(60.0)
    assert live.published == []
    live.now += 0.1
    live.pose()
    assert len(live.published) == 2


def test_the_driver_stays_and_feeds_the_watchdog():
    nodes, parameters = expand(LAUNCH / "first_flight.launch", uri="udp://127.0.0.1:19999")
    assert {"/crazyflie_server", "/crazyflie_add"} == {*nodes}
    assert parameters["/crazyflie_server/emergency_watchdog"] is True
    # A second driver would be refused the vehicle.
    stack, _ = expand(LAUNCH / "hw_hover.launch", driver="false", rviz="false")
    assert not [name for name in stack if name.startswith("/crazyflie")]
    assert "/takeoff_server" in stack
