"""The simulator node on a fake process."""

import math

import pytest

from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_simulator.simulator_node import NearHoverSimulatorNode
from crazyflie_utils.fake import FakeProcess

PARAMETERS = {
    "time_step": 0.01,
    "init/x": 1,
    "init/y": 2.0,
    "init/z": 0.0,
    "frames/fixed": "world",
    "frames/robot": "crazyflie",
    "topics/control": "/control/final",
}


def launch(**changes):
    """Return a process with a simulator in it."""
    process = FakeProcess()
    assert process.launch(NearHoverSimulatorNode(), "/simulator", {**PARAMETERS, **changes})
    return process


def command(process, thrust):
    process.publish("/control/final", ControlStamped(control=Control(thrust=thrust)))


def heights(process):
    return [message.transforms[0].transform.translation.z for message in process.published("/tf")]


@pytest.mark.parametrize("name", PARAMETERS)
def test_every_parameter_is_required(name):
    process = FakeProcess()
    parameters = {key: value for key, value in PARAMETERS.items() if key != name}
    assert not process.launch(NearHoverSimulatorNode(), "/simulator", parameters)
    assert f"/simulator/{name} is not set" in process.logged("error")[0]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("time_step", -0.01),
        ("time_step", 0),
        ("time_step", math.nan),
        ("time_step", "fast"),
        ("init/x", "left"),
        ("init/z", math.inf),
        ("frames/robot", 3),
        ("topics/control", ""),
        ("clock/real_time_factor", -1.0),
    ],
)
def test_bad_parameters_are_named(name, value):
    process = FakeProcess()
    assert not process.launch(NearHoverSimulatorNode(), "/simulator", {**PARAMETERS, name: value})
    assert f"/simulator/{name} is" in process.logged("error")[0]
    assert "expected" in process.logged("error")[0]


def test_broadcasts_every_time_step_with_the_vehicles_stamp():
    process = launch()
    process.advance(1.0)
    stamps = [message.transforms[0].header.stamp.to_sec() for message in process.published("/tf")]
    assert stamps == pytest.approx([100.0 + 0.01 * k for k in range(1, 101)])
    transform = process.published("/tf")[-1].transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "crazyflie")
    assert transform.transform.translation.x == 1.0
    assert transform.transform.translation.y == 2.0


def test_climbs_on_command():
    process = launch()
    for _ in range(10):
        command(process, 11.81)
        process.advance(0.1)
    assert heights(process)[-1] == pytest.approx(1.0)


def test_ignores_controls_that_are_not_finite():
    process = launch()
    command(process, 11.81)
    for _ in range(4):
        process.advance(0.1)
        command(process, math.nan)
    assert heights(process)[-1] == pytest.approx(0.5 * 2.0 * 0.4**2)
    assert len(process.logged("warn")) == 1
    for _ in range(60):
        process.advance(0.1)
        command(process, math.inf)
    assert all(map(math.isfinite, heights(process)))
    assert heights(process)[-1] < max(heights(process))


def test_clock_needs_simulated_time_to_be_on():
    process = launch(**{"clock/publish": True})
    assert process.published("/clock") == []
