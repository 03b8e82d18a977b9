"""Step 4: the mission, with a vehicle that is where its reference is."""

import math
from concurrent.futures import Future

import pytest
from std_srvs.srv import EmptyResponse

from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_tutorial_msgs.srv import VelocityAtResponse
from crazyflie_utils.testing import FakeProcess
from my_sweep.oscillator_node import OscillatorNode
from my_sweep.sweep_node import SweepNode


def answered(response):
    """Return the future of a call that has been answered."""
    reply = Future()
    reply.set_result(response)
    return reply


@pytest.fixture
def process():
    """Return a process with both nodes and a vehicle at the origin that may fly and land."""
    fake = FakeProcess()
    fake.landings = []

    def land(_):
        fake.landings.append(True)
        return answered(EmptyResponse())

    fake.transport.services["/land"] = land
    assert fake.launch(OscillatorNode(), "/oscillator")
    assert fake.launch(SweepNode(), "/sweep")
    fake.publish("/state", PositionVelocityYawStateStamped(state=PositionVelocityYawState(z=1.0)))
    return fake


def references(process):
    """Return the positions (x, y, z) that were published."""
    return [(m.state.x, m.state.y, m.state.z) for m in process.published("/ref")]


def test_is_silent_on_the_ground(process):
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.TAKING_OFF))
    process.advance(2.0)
    assert references(process) == []


def test_flies_all_lanes_and_arcs_then_lands_once(process):
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    process.advance(60.0)
    points = references(process)
    assert points[0] == pytest.approx((0.0, 0.0, 1.0), abs=0.1)
    for place in ((-1.5, -1.0), (1.5, -1.0), (2.0, -0.5), (1.5, 0.0), (-2.0, 0.5), (-1.5, 1.0)):
        assert min((x - place[0]) ** 2 + (y - place[1]) ** 2 for x, y, _ in points) < 0.1**2
    assert points[-1] == pytest.approx((1.5, 1.0, 1.0))
    steps = [math.dist(a, b) for a, b in zip(points, points[1:], strict=False)]
    assert max(steps) == pytest.approx(0.07, abs=1e-6)
    assert process.landings == [True]


def test_the_reference_says_how_fast_it_moves(process):
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    process.advance(10.0)
    before, state = (message.state for message in process.published("/ref")[-2:])
    moved = (state.x - before.x, state.y - before.y)
    assert (state.x_dot, state.y_dot) == pytest.approx([each / 0.1 for each in moved], abs=0.1)
    assert math.hypot(state.x_dot, state.y_dot) > 0.1


@pytest.mark.parametrize(("velocity", "reason"), [(None, "/my_oscillator"), (math.nan, "nan")])
def test_hovers_without_a_velocity(velocity, reason):
    process = FakeProcess()
    if velocity is not None:
        response = VelocityAtResponse(velocity)
        process.transport.services["/my_oscillator"] = lambda _: answered(response)
    assert process.launch(SweepNode(), "/sweep")
    process.publish(
        "/state", PositionVelocityYawStateStamped(state=PositionVelocityYawState(x=0.3))
    )
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    process.advance(5.0)
    assert references(process)[-1] == pytest.approx((0.3, 0.0, 1.0))
    assert reason in process.logged("warn")[0]
