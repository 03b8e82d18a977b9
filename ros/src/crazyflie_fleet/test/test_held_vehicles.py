"""Vehicles that are held: for whom, and how they go on."""

import pytest
from test_references_node import Flight, flight_status

from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped


def held(flight):
    """Return the names of the vehicles that are held."""
    return "".join(message.data for message in flight.process.published("/fleet/waiting")[-1:])


def test_one_on_the_ground_holds_no_vehicle():
    flight = Flight()
    flight.process.publish("/cf2/in_flight_flight_status", flight_status("ON_GROUND"))
    flight.see("cf1", 0.8)
    flight.want("cf1", 0.95)
    flight.process.advance(0.2)
    assert flight.followed("cf1")[-1].state.y == 0.95
    assert held(flight) == ""


def test_the_last_speed_of_one_that_is_not_seen_does_not_count():
    flight = Flight()
    flight.see("cf2", 1.0, y_dot=-1.6)
    flight.silence("cf2")
    flight.process.advance(1.5)
    flight.see("cf1", 0.2)
    flight.want("cf1", 0.3)
    flight.process.advance(0.2)
    assert held(flight) == ""


def test_a_way_goes_on_after_a_hold_where_it_was():
    flight = Flight()
    flight.see("cf2", 0.55)
    flight.go_to(goal=(0.0, 0.5, 1.0), seconds=2.0)
    flight.see("cf1", 0.28)
    flight.process.advance(5.0)
    assert held(flight) == "cf1"
    flight.see("cf2", 3.0)
    flight.process.advance(0.1)
    assert held(flight) == ""
    assert flight.followed("cf1")[-1].state.y < 0.3
    flight.process.advance(2.0)
    assert flight.followed("cf1")[-1].state.y == pytest.approx(0.5)


def test_a_reference_that_moves_does_so_after_a_hold():
    flight = Flight()
    moving = PositionVelocityStateStamped(state=PositionVelocityState(y=0.9, z=1.0, y_dot=0.2))
    moving.header.stamp = flight.process.clock.stamp()
    flight.process.publish("/cf1/ref", moving)
    flight.see("cf1", 0.8)
    flight.process.advance(0.06)
    assert flight.followed("cf1")[-1].state.y_dot == 0.0
    flight.see("cf2", 2.0)
    flight.process.advance(0.06)
    assert flight.followed("cf1")[-1].state == moving.state
