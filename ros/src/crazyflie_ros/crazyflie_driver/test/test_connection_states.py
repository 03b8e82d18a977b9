"""The states of a vehicle's connection, from adding to removing."""

import pytest

from crazyflie_driver.context import TRANSITIONS, Connection, ConnectionEvent, ConnectionState

CONNECTING, SETTING_UP, READY, LOST, RESUMING, CLOSING, CLOSED = ConnectionState


def after(*events):
    """Return the states that a connection goes through."""
    connection = Connection("new")
    return [connection.handle(event) for event in events]


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
    connection = Connection("new")
    for event in set(ConnectionEvent) - {ConnectionEvent.LINK_OPENED, ConnectionEvent.REMOVAL}:
        assert connection.handle(event) is CONNECTING
    assert not connection.is_ready()
    connection.handle(ConnectionEvent.LINK_OPENED)
    for event in (ConnectionEvent.LINK_LOST, ConnectionEvent.LINK_RENEWED):
        assert connection.handle(event) is SETTING_UP
    assert not connection.is_ready()
    connection.handle(ConnectionEvent.ANNOUNCED)
    assert connection.is_ready()
    # Topics and services stay while the link is lost.
    for event in (ConnectionEvent.LINK_LOST, ConnectionEvent.LINK_RENEWED):
        connection.handle(event)
        assert connection.is_ready()


@pytest.mark.parametrize("state", [CONNECTING, SETTING_UP, READY, LOST, RESUMING])
def test_every_vehicle_can_be_removed_and_does_not_come_back(state):
    connection = Connection("new")
    connection.state = state
    assert not connection.is_closing()
    assert connection.handle(ConnectionEvent.REMOVAL) is CLOSING
    for event in set(ConnectionEvent) - {ConnectionEvent.REMOVED}:
        assert connection.handle(event) is CLOSING
    assert connection.is_closing()
    assert not connection.is_ready()
    assert connection.handle(ConnectionEvent.REMOVED) is CLOSED
    assert {connection.handle(event) for event in ConnectionEvent} == {CLOSED}
    assert connection.is_closing()


def test_every_state_can_be_reached():
    assert {CONNECTING, *TRANSITIONS.values()} == set(ConnectionState)
