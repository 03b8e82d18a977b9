"""The states of a vehicle's connection, from adding to removing."""

import pytest

from crazyflie_driver.vehicle_base import TRANSITIONS, BaseVehicle, ConnectionEvent, ConnectionState

CONNECTING, SETTING_UP, READY, LOST, RESUMING, CLOSING, CLOSED = ConnectionState


def make_vehicle():
    """Return a vehicle that has only a state."""
    return BaseVehicle(*[None] * 7, link_text="new")


def after(*events):
    """Return the states that a vehicle goes through."""
    vehicle = make_vehicle()
    return [vehicle.transition(event) for event in events]


def test_a_flight_with_a_silence_and_a_new_link():
    event = ConnectionEvent
    assert after(
        event.LINK_OPENED,
        event.ANNOUNCED,
        event.LINK_LOST,
        event.LINK_HEARD,
        event.LINK_LOST,
        event.LINK_RENEWED,
        event.LINK_LOST,
        event.LINK_RENEWED,
        event.RESUMED,
        event.REMOVAL,
        event.REMOVED,
    ) == [SETTING_UP, READY, LOST, READY, LOST, RESUMING, LOST, RESUMING, READY, CLOSING, CLOSED]


def test_a_vehicle_is_ready_only_once_it_has_been_announced():
    vehicle = make_vehicle()
    for event in set(ConnectionEvent) - {ConnectionEvent.LINK_OPENED, ConnectionEvent.REMOVAL}:
        assert vehicle.transition(event) is CONNECTING
    assert not vehicle.is_ready()
    vehicle.transition(ConnectionEvent.LINK_OPENED)
    for event in (ConnectionEvent.LINK_LOST, ConnectionEvent.LINK_RENEWED):
        assert vehicle.transition(event) is SETTING_UP
    assert not vehicle.is_ready()
    vehicle.transition(ConnectionEvent.ANNOUNCED)
    assert vehicle.is_ready()
    # Topics and services stay while the link is lost.
    for event in (ConnectionEvent.LINK_LOST, ConnectionEvent.LINK_RENEWED):
        vehicle.transition(event)
        assert vehicle.is_ready()


@pytest.mark.parametrize("state", [CONNECTING, SETTING_UP, READY, LOST, RESUMING])
def test_every_vehicle_can_be_removed_and_does_not_come_back(state):
    vehicle = make_vehicle()
    vehicle.state = state
    assert not vehicle.is_closing()
    assert vehicle.transition(ConnectionEvent.REMOVAL) is CLOSING
    for event in set(ConnectionEvent) - {ConnectionEvent.REMOVED}:
        assert vehicle.transition(event) is CLOSING
    assert vehicle.is_closing()
    assert not vehicle.is_ready()
    assert vehicle.transition(ConnectionEvent.REMOVED) is CLOSED
    assert {vehicle.transition(event) for event in ConnectionEvent} == {CLOSED}
    assert vehicle.is_closing()


def test_every_state_can_be_reached():
    assert {CONNECTING, *TRANSITIONS.values()} == set(ConnectionState)
