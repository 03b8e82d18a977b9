"""A controller that is restarted in flight, and one whose states are late."""

import numpy as np
import pytest
from lift_controller import answer, launch, publish_flight_state, refer

from crazyflie_msgs.msg import (
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)

HOVER = [0.0, 0.0, 0.0, 9.81]


@pytest.fixture
def process():
    return launch()


def test_without_a_reference_it_keeps_the_place_of_a_vehicle_in_flight(process):
    publish_flight_state(process, "flying")
    [first] = answer(process, x=1.0, y=-2.0, z=1.5, yaw=0.3)
    np.testing.assert_allclose(first, HOVER, atol=1e-12)
    [second] = answer(process, x=1.1, y=-2.0, z=1.5)
    assert second[1] < 0.0
    # The latched reference, or a later one, is followed.
    refer(process, x=1.4, y=-2.0, z=1.5)
    [third] = answer(process, x=1.1, y=-2.0, z=1.5)
    assert third[1] > 0.0


@pytest.mark.parametrize("state", ["on_ground", "taking_off", "landing"])
def test_it_is_silent_without_a_reference_otherwise(process, state):
    publish_flight_state(process, state)
    assert answer(process, z=1.0) == []


@pytest.mark.parametrize(
    ("had_fresh_ones", "words"),
    [
        (True, "this computer, or the network, is too busy"),
        (False, "do the machines' clocks agree"),
    ],
)
def test_why_states_are_late_is_reported_once(process, had_fresh_ones, words):
    refer(process)
    if had_fresh_ones:
        answer(process)
    for _ in range(30):
        process.advance(0.1)
        message = PositionVelocityYawStateStamped(state=PositionVelocityYawState())
        message.header.stamp = process.clock.stamp(process.clock.time() - 0.7)
        process.publish("/state", message)
    [warning] = process.logged("warn")
    assert words in warning
    assert "0.7 s old" in warning
