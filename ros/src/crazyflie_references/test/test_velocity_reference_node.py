"""The node on a fake process."""

import math

import pytest
from geometry_msgs.msg import Twist, Vector3

from crazyflie_msgs.msg import FlightStatus, PositionVelocityState, PositionVelocityStateStamped
from crazyflie_references.velocity_reference_node import VelocityReferenceNode
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.vectors import to_vector

PARAMETERS = {"topics/reference": "/ref", "topics/controller_reference": "/ref/yaw"}
AHEAD = Twist(linear=Vector3(x=0.4))


@pytest.fixture
def process():
    fake = FakeProcess()
    assert fake.launch(VelocityReferenceNode(), "/velocity_reference", PARAMETERS)
    return fake


def refer(process, x, y, z):
    state = PositionVelocityState(x=x, y=y, z=z)
    process.publish("/ref", PositionVelocityStateStamped(state=state))


def take_off(process):
    refer(process, 0.0, 0.0, 1.0)
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))


def fly(process, twist, duration):
    for _ in range(round(duration / 0.1)):
        process.publish("/cmd_vel", twist)
        process.advance(0.1)


def references(process):
    return [to_vector(message.state) for message in process.published("/ref/yaw")]


def test_references_of_others_are_passed_on(process):
    refer(process, 0.3, -0.2, 1.0)
    assert references(process)[-1].tolist() == [0.3, -0.2, 1.0, 0.0, 0.0, 0.0, 0.0]
    assert process.published("/ref/yaw")[-1].header.stamp.to_sec() == pytest.approx(100.0)


def test_flies_where_cmd_vel_says(process):
    take_off(process)
    fly(process, AHEAD, 3.0)
    last = references(process)[-1]
    # 3 s, less what speeding up with 1 m/s^2 takes.
    assert last[0] == pytest.approx(0.4 * 3.0 - 0.4**2 / 2.0, abs=0.01)
    assert last[1:] == pytest.approx([0.0, 1.0, 0.4, 0.0, 0.0, 0.0])
    assert len(references(process)) == pytest.approx(150, abs=3)


def test_stops_half_a_second_after_the_last_velocity(process):
    take_off(process)
    fly(process, AHEAD, 3.0)
    process.advance(0.39)
    assert references(process)[-1][3] == pytest.approx(0.4)
    process.advance(0.6)
    rest = references(process)[-1]
    assert rest[3:6] == pytest.approx([0.0, 0.0, 0.0])
    count = len(references(process))
    process.advance(5.0)
    assert len(references(process)) == count, "the topic is left to others"


@pytest.mark.parametrize("state", ["", "on_ground", "taking_off", "descending", "landing"])
def test_only_in_flight(process, state):
    refer(process, 0.0, 0.0, 1.0)
    if state:
        process.publish(
            "/in_flight_flight_status", FlightStatus(state=getattr(FlightStatus, state.upper()))
        )
    fly(process, AHEAD, 1.0)
    assert len(references(process)) == 1


def test_a_landing_has_the_reference_for_itself(process):
    take_off(process)
    fly(process, Twist(linear=Vector3(x=0.4), angular=Vector3(z=0.5)), 2.0)
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.DESCENDING))
    yaw = references(process)[-1][6]
    count = len(references(process))
    for k in range(10):
        refer(process, 0.5, 0.1, 0.9 - 0.01 * k)
        fly(process, AHEAD, 0.1)
    assert len(references(process)) == count + 10
    # It lands as it looks: the nose does not turn back.
    assert references(process)[-1][6] == yaw == pytest.approx(1.0, abs=0.02)
    assert references(process)[-1][:3] == pytest.approx([0.5, 0.1, 0.81])


def test_after_a_reference_of_others_it_goes_on_from_there(process):
    take_off(process)
    fly(process, AHEAD, 1.0)
    refer(process, 2.0, 2.0, 1.5)
    fly(process, AHEAD, 0.1)
    assert references(process)[-1][:3] == pytest.approx([2.0, 2.0, 1.5], abs=0.05)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_velocity_that_is_not_finite_counts_as_silence(process, bad):
    take_off(process)
    fly(process, AHEAD, 2.0)
    fly(process, Twist(linear=Vector3(x=bad)), 2.0)
    assert references(process)[-1][3] == pytest.approx(0.0)
    assert "/cmd_vel: it is not finite" in process.logged("warn")[0]


def test_bad_limits_are_named():
    fake = FakeProcess()
    bad = {**PARAMETERS, "limits/min_height": 3.0}
    assert not fake.launch(VelocityReferenceNode(), "/velocity_reference", bad)
    assert "limits/min_height is 3; expected <= limits/max_height, 2 (m)" in fake.logged("error")[0]
