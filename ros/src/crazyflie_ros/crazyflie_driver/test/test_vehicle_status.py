"""The typed status of a vehicle says what the words say, and more."""

import math

import pytest
from conftest import LOG
from safety_helpers import FLYING, LOCKED, TAKEOFF, is_, position, said, wait_for_words
from std_msgs.msg import Empty
from std_srvs.srv import EmptyRequest

from crazyflie_msgs.msg import VehicleStatus
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.programs import wait_until


def published(server):
    return server.process.published("/cf1/vehicle_status")


def test_the_link_from_the_first_moment_on(server):
    vehicle = server.make_vehicle()
    adding = server.begin_adding(vehicle.uri)
    first = published(server)[0]
    assert first.link == VehicleStatus.DISCONNECTED
    assert "connecting to udp://" in first.link_text
    assert not first.has_supervisor
    assert math.isnan(first.latency)
    adding.result(timeout=60.0)
    wait_for_words(server, "ready")
    latest = published(server)[-1]
    assert (latest.link, latest.text) == (VehicleStatus.CONNECTED, said(server))
    vehicle.is_frozen = True
    wait_for_words(server, "lost")
    latest = published(server)[-1]
    assert latest.link == VehicleStatus.LOST
    assert "has not been heard" in latest.link_text
    assert not latest.has_supervisor


def test_flight_battery_and_figures(server, vehicle):
    is_(vehicle, FLYING)
    wait_for_words(server, "flying: on high-level commands")
    assert not published(server)[-1].is_streamed
    position(server)
    wait_for_words(server, "flying: on setpoints")
    vehicle.log["pm.vbat"] = ("f", 3.125)
    wait_for_words(server, "battery low")
    latest = published(server)[-1]
    assert latest.supervisor == FLYING
    assert latest.supervisor & VehicleStatus.FLYING
    assert latest.is_streamed
    assert (latest.battery, latest.battery_voltage) == (VehicleStatus.BATTERY_LOW, 3.125)
    assert latest.rssi == 47.0
    assert 0.0 <= latest.link_quality <= 1.0
    assert latest.last_heard < 1.0


def test_states_that_end_a_flight(server, vehicle):
    is_(vehicle, LOCKED)
    wait_for_words(server, "cannot fly: locked")
    assert published(server)[-1].supervisor & VehicleStatus.LOCKED
    server.call("/cf1/emergency", EmptyRequest())
    assert published(server)[-1].is_emergency


def test_it_is_repeated_and_otherwise_published_when_it_changes(server, vehicle):
    wait_for_words(server, "ready")
    before = len(published(server))
    wait_until(lambda: server.process.advance(0.1) or len(published(server)) >= before + 3)
    texts = {message.text for message in published(server)[before:]}
    assert texts == {said(server)}
    stamps = [message.header.stamp.to_sec() for message in published(server)[before:]]
    assert stamps == sorted(set(stamps))


def test_the_fields_of_crazyswarm2(make_server):
    server = make_server()
    log = {**LOG, "pm.state": ("b", 3), "radio.numRxBc": ("H", 0), "radio.numRxUc": ("H", 65530)}
    vehicle = server.make_vehicle(log=log)
    server.add(vehicle.uri)
    wait_for_words(server, "ready")
    server.process.advance(1.0)
    # The vehicle's counters have 16 bits.
    vehicle.log.update({"radio.numRxBc": ("H", 7), "radio.numRxUc": ("H", 4)})
    driver = server.node._vehicles[vehicle.uri]
    wait_until(lambda: server.process.advance(0.01) or driver.log.received_broadcasts == 7)
    server.process.advance(1.0)
    first = next(status for status in reversed(published(server)) if status.num_rx_broadcast)
    assert (first.num_rx_broadcast, first.num_rx_unicast) == (7, 10)
    assert (first.pm_state, first.rssi) == (VehicleStatus.PM_STATE_LOW_POWER, 47.0)
    assert first.supervisor_info == first.supervisor
    server.process.publish("/all/emergency", Empty())
    wait_until(
        lambda: server.process.advance(0.1) or published(server)[-1].num_tx_broadcast,
        "broadcasts that were sent",
    )
    assert any(status.num_tx_unicast for status in published(server))
    # A restart of the vehicle begins at 0.
    vehicle.log.update({"radio.numRxBc": ("H", 0)})
    wait_until(lambda: server.process.advance(0.01) or driver.log.received_broadcasts == 0)
    server.process.advance(1.0)
    assert published(server)[-1].num_rx_broadcast == 0


def test_a_vehicle_without_these_variables(server, vehicle):
    wait_for_words(server, "ready")
    server.process.advance(1.0)
    status = published(server)[-1]
    assert status.pm_state == VehicleStatus.PM_STATE_UNKNOWN
    assert (status.num_rx_broadcast, status.num_rx_unicast) == (0, 0)


def test_the_fault_of_a_deck_is_named(server, vehicle):
    """Of firmware 2026.08: such a vehicle disarms, and is not armed."""
    is_(vehicle, 0x804)
    wait_for_words(server, "cannot fly: deck fault; switch the vehicle off, and see that its decks")
    with pytest.raises(ServiceError, match="the vehicle cannot fly, its state is: .*deck fault"):
        server.call("/cf1/takeoff", TAKEOFF)
    assert vehicle.packets(8, 0) == []
