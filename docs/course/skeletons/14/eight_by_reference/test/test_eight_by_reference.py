"""The figure of eight by references, first the algorithm, then the node on a fake process."""

import math

import numpy as np
import pytest

from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing import FakeProcess
from eight_by_reference import eight_node
from eight_by_reference.eight import Eight

PERIOD = 2.0 * math.pi * 0.5 / 0.3
"""Of one circle of the default radius and speed, s."""

NO_CONTROL = {"cmd_vel": "nothing here listens to it", "crazyflie/cmd_vel": "degrees and PWM"}


def test_step_1_the_topic_is_one_for_positions():
    topic = eight_node.TOPIC.lstrip("/")
    assert topic not in NO_CONTROL, f"{topic}: {NO_CONTROL[topic]}"
    assert topic == "ref"
    assert eight_node.TYPE == "crazyflie_msgs/PositionVelocityStateStamped"


def test_step_2_the_way_is_an_eight():
    eight = Eight((1.0, 2.0, 0.8))
    times = np.linspace(0.0, 2.0 * PERIOD, 2001)
    way = np.array([eight.position(time) for time in times])
    assert way[0] == pytest.approx((1.0, 2.0, 0.8))
    assert way[-1] == pytest.approx((1.0, 2.0, 0.8), abs=1e-6)
    assert (way[:, 1].min(), way[:, 1].max()) == pytest.approx((1.0, 3.0), abs=0.001)
    assert way[times < PERIOD, 1].max() < 2.001
    assert way[5, 0] > 1.0


@pytest.mark.parametrize("time", [0.3, 4.0, 11.0, 20.0])
def test_step_3_the_velocity_is_that_of_the_position(time):
    eight = Eight((1.0, 2.0, 0.8))
    before, after = (np.array(eight.position(time + dt)) for dt in (-1e-4, 1e-4))
    assert eight.velocity(time) == pytest.approx(tuple((after - before) / 2e-4), abs=1e-4)
    assert math.hypot(*eight.velocity(time)) == pytest.approx(0.3)


@pytest.fixture
def process():
    """Return a process with the node in it, and a vehicle at (1, 0, 1)."""
    fake = FakeProcess()
    assert fake.launch(eight_node.EightNode(), "/eight")
    place = PositionVelocityYawState(x=1.0, z=1.0)
    fake.publish("/state", PositionVelocityYawStateStamped(state=place))
    return fake


def test_step_4_publishes_references_in_flight_from_where_the_vehicle_is(process):
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    process.advance(PERIOD / 4.0)
    first, last = (process.published("/ref")[k].state for k in (0, -1))
    assert (first.x, first.y, first.z) == pytest.approx((1.0, 0.0, 1.0), abs=0.02)
    assert (last.x, last.y, last.z) == pytest.approx((1.5, -0.5, 1.0), abs=0.02)
    assert (last.x_dot, last.y_dot) == pytest.approx((0.0, -0.3), abs=0.02)


def test_step_4_is_silent_on_the_ground_and_after_the_flight(process):
    process.advance(1.0)
    assert process.published("/ref") == []
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    process.advance(1.0)
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.DESCENDING))
    count = len(process.published("/ref"))
    process.advance(1.0)
    assert len(process.published("/ref")) == count > 0
