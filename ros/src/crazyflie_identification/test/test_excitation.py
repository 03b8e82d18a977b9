"""The excitation, and the node that adds it to a flight."""

import math

import numpy as np
import pytest

from crazyflie_identification import excitation
from crazyflie_identification.excitation_node import SETTLED, ExcitationNode
from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    FlightStatus,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing import FakeProcess

TOPICS = {
    "control": "/control/lqr",
    "excited": "/control/excited",
    "reference": "/ref",
    "state": "/state",
    "flight_status": "/in_flight_flight_status",
}


def test_it_is_small_and_begins_and_ends_at_rest():
    times = np.arange(0.0, 60.0, 0.01)
    added = np.array([excitation.controls(t) for t in times])
    most = [math.radians(5), math.radians(5), math.radians(61), 1.21]
    assert (np.abs(added).max(axis=0) < most).all()
    assert excitation.controls(0.0) == (0.0,) * 4
    offsets, speeds = zip(*(excitation.reference(t) for t in times), strict=True)
    assert np.linalg.norm(offsets, axis=1).max() < 0.6
    assert np.linalg.norm(speeds, axis=1).max() < 0.6
    assert excitation.reference(0.0)[0] == (0.0, 0.0, 0.0)


@pytest.fixture
def process():
    """Return a process with the node, in a flight that has begun."""
    process = FakeProcess()
    parameters = {**{f"topics/{name}": topic for name, topic in TOPICS.items()}, "duration": 10.0}
    assert process.launch(ExcitationNode(), "/excitation", parameters)
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    return process


def state(process, x=0.0, x_dot=0.0):
    own = PositionVelocityYawState(x=x, z=1.0, x_dot=x_dot)
    process.publish("/state", PositionVelocityYawStateStamped(state=own))


def added(process):
    """Return what is added to a control."""
    control = Control(roll=0.01, pitch=-0.02, yaw_dot=0.1, thrust=9.9)
    process.publish("/control/lqr", ControlStamped(control=control))
    sent = process.published("/control/excited")[-1].control
    return [getattr(sent, name) - getattr(control, name) for name in Control.__slots__]


def test_controls_pass_before_and_after_it_as_they_are(process):
    state(process)
    assert added(process) == [0.0] * 4
    process.advance(SETTLED + 2.5)
    assert max(map(abs, added(process))) > 0.01
    assert process.published("/ref")[-1].state.x != 0.0
    process.advance(10.0)
    assert added(process) == [0.0] * 4
    last = process.published("/ref")[-1].state
    assert (last.x, last.y, last.z, last.x_dot) == (0.0, 0.0, 1.0, 0.0)
    process.advance(20.0)
    assert added(process) == [0.0] * 4
    assert any("excitation is over" in text for text in process.logged("info"))


@pytest.mark.parametrize(("x", "x_dot"), [(1.0, 0.0), (0.1, 1.5)])
def test_a_vehicle_that_leaves_the_middle_ends_it(process, x, x_dot):
    state(process)
    process.advance(SETTLED + 3.0)
    state(process, x, x_dot)
    assert added(process) == [0.0] * 4
    [warning] = process.logged("warn")
    assert f"{math.hypot(x, 0):.2f} m from the middle, at {x_dot:.2f} m/s; expected" in warning


def test_a_landing_ends_it(process):
    state(process)
    process.advance(SETTLED + 3.0)
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.LANDING))
    count = len(process.published("/ref"))
    process.advance(2.0)
    assert added(process) == [0.0] * 4
    assert len(process.published("/ref")) == count
