"""Faults of a vehicle, its link and its users, down to the bytes on the link."""

import pytest
from genpy import Duration
from safety_helpers import (
    FLYING,
    HIGH_LEVEL,
    LAND,
    READY,
    SETPOINTS_STOP,
    TAKEOFF,
    ZERO,
    is_,
    position,
    said,
    thrust,
    wait_for_words,
)
from std_msgs.msg import Empty
from std_srvs.srv import EmptyRequest

from crazyflie_driver.msg import TrajectoryPolynomialPiece
from crazyflie_driver.srv import (
    GoToRequest,
    StartTrajectoryRequest,
    StopRequest,
    UploadTrajectoryRequest,
)
from crazyflie_driver.vehicle_base import ConnectionState
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.peer import wait_until

LIMIT = 60.0

# A lost link.


@pytest.mark.parametrize("send", [position, thrust])
def test_a_stale_stream_does_not_start_a_vehicle_that_was_restarted(server, vehicle, send):
    def count():
        return len(vehicle.packets(7, 0)) + len([d for d in vehicle.packets(3, 0) if d != ZERO])

    is_(vehicle, FLYING)
    wait_for_words(server, "flying")
    send(server)
    wait_until(lambda: count() == 1, "the setpoint")
    vehicle.is_frozen = True
    for _ in range(200):
        server.process.advance(0.02)
        send(server)
        if "lost" in said(server):
            break
        vehicle.wait_for(lambda: False, 0.02)
    # Its battery is changed.
    vehicle.forget_logs()
    is_(vehicle, READY)
    vehicle.received.clear()
    vehicle.is_frozen = False

    def is_back():
        server.process.advance(0.02)
        send(server)
        return "ready" in said(server)

    wait_until(is_back, "the link's return")
    for _ in range(50):
        server.process.advance(0.02)
        send(server)
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 2)
    assert count() == 0
    assert "setpoints are ignored since the link was lost" in said(server)
    # A new stream, whose thrust begins at zero.
    server.process.advance(1.5)
    if send is thrust:
        thrust(server, 0.0)
        vehicle.wait_for_packets(3, 0)
        vehicle.received.clear()
    send(server)
    wait_until(lambda: count() == 1, "the new stream")


def test_a_flight_goes_on_when_the_vehicle_still_flies(hovering):
    server, vehicle = hovering
    vehicle.is_frozen = True
    wait_for_words(server, "lost")
    vehicle.is_frozen = False
    wait_for_words(server, "flying")
    vehicle.received.clear()
    position(server)
    assert len(vehicle.wait_for_packets(7, 0)) == 1
    assert vehicle.packets(3, 0) == []


def test_a_restart_within_the_time_of_a_ping(server, vehicle):
    server.process.advance(0.1)
    vehicle.forget_logs()
    wait_for_words(server, "the log data have stopped although the vehicle answers")
    wait_for_words(server, "ready")


def test_half_of_the_packets_lost_is_reported(server, vehicle):
    vehicle.lose = lambda count: count % 2 == 0
    wait_for_words(server, "poor link")


# Commands.


def test_landing_and_stopping_take_the_place_of_an_upload(server, vehicle):
    is_(vehicle, HIGH_LEVEL)
    piece = TrajectoryPolynomialPiece(duration=Duration(1))
    vehicle.deaf.add((4, 2, b""))
    upload = UploadTrajectoryRequest(3, 0, [piece] * 31)
    for service, request in (("land", LAND), ("stop", StopRequest(0))):
        vehicle.received.clear()
        uploading = server.process.call("/cf1/upload_trajectory", upload)
        following = server.process.call("/cf1/go_to", GoToRequest(duration=Duration(1)))
        vehicle.wait_for_packets(4, 2)
        server.call(f"/cf1/{service}", request)
        assert not uploading.done() or uploading.exception() is not None
        for given_up in (uploading, following):
            with pytest.raises(ServiceError):
                given_up.result(timeout=LIMIT)
        assert [data[0] for data in vehicle.packets(8, 0)] == [{"land": 8, "stop": 3}[service]]
        # The packet that got no answer is tried 5 times.
        assert len(vehicle.packets(4, 2)) <= 6
    vehicle.deaf.clear()
    with pytest.raises(ServiceError, match="3 has not been uploaded"):
        server.call("/cf1/start_trajectory", StartTrajectoryRequest(0, 3, 1.0, False, False))


def test_an_emergency_goes_before_an_upload_and_ends_it(server, vehicle):
    piece = TrajectoryPolynomialPiece(duration=Duration(1))
    vehicle.deaf.add((4, 2, b""))
    busy = server.make_vehicle()
    busy.deaf.add((4, 0, b""))
    connecting = server.begin_adding(busy.uri, "busy")
    upload = UploadTrajectoryRequest(3, 0, [piece] * 31)
    uploading = server.process.call("/cf1/upload_trajectory", upload)
    vehicle.wait_for_packets(4, 2)
    vehicle.received.clear()
    server.call("/cf1/emergency", EmptyRequest())
    vehicle.wait_for_packets(9, 1)
    assert len(vehicle.packets(4, 2)) <= 1
    with pytest.raises(ServiceError):
        uploading.result(timeout=LIMIT)
    assert not connecting.done()
    assert said(server) == "emergency stop: remove, restart and add the vehicle"


def test_one_emergency_stops_all(server):
    vehicles = [server.make_vehicle() for _ in range(3)]
    for k, vehicle in enumerate(vehicles):
        server.add(vehicle.uri, f"cf{k}")
    server.process.publish("/all/emergency", Empty())
    for k, vehicle in enumerate(vehicles):
        assert vehicle.wait_for_packets(9, 1)[0] == b"\x03"
        with pytest.raises(ServiceError, match="emergency stop: remove"):
            server.call(f"/cf{k}/takeoff", TAKEOFF)


def test_an_emergency_while_connecting_is_kept(server):
    vehicle = server.make_vehicle()
    vehicle.deaf.add((4, 0, b""))
    adding = server.begin_adding(vehicle.uri, enable_parameters=True)
    vehicle.wait_for_packets(4, 0)
    server.process.publish("/all/emergency", Empty())
    vehicle.deaf.clear()
    adding.result(timeout=LIMIT)
    vehicle.wait_for_packets(9, 1)
    assert vehicle.packets(3, 0) == []
    # All else is as without it.
    driven = server.node._vehicles[vehicle.uri]
    assert server.process.transport.parameters["/cf1/ring/effect"] == 6
    assert driven.state is ConnectionState.READY


# Battery and watchdog.


def test_a_low_battery_does_not_take_off(server, vehicle):
    vehicle.log["pm.vbat"] = ("f", 3.1)
    wait_for_words(server, "battery low")
    with pytest.raises(ServiceError, match="no takeoff, battery low: 3.10 V"):
        server.call("/cf1/takeoff", TAKEOFF)
    assert vehicle.packets(8, 0) == []
    server.process.advance(1.0)
    assert server.process.published("/diagnostics")[-1].status[0].message == "battery low: 3.10 V"


@pytest.mark.parametrize("is_streamed", [False, True])
def test_a_critical_battery_lands_a_flight(server, vehicle, is_streamed):
    server.call("/cf1/takeoff", TAKEOFF)
    server.process.advance(1.0)
    if is_streamed:
        position(server)
        vehicle.wait_for_packets(7, 0)
    is_(vehicle, FLYING if is_streamed else HIGH_LEVEL)
    vehicle.log["pm.vbat"] = ("f", 2.9)
    wait_for_words(server, "battery low")
    assert len(vehicle.packets(8, 0)) == 1
    server.process.advance(5.0)
    wait_for_words(server, "battery critical")
    assert [data[0] for data in vehicle.wait_for_packets(8, 0, 2)] == [7, 8]
    assert vehicle.packets(7, 1) == [SETPOINTS_STOP] * is_streamed


FEED = b"\x04"


def test_the_emergency_watchdog_is_fed_from_the_first_command_on(make_server):
    server = make_server({"emergency_watchdog": True})
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    server.process.advance(1.0)
    vehicle.wait_for_packets(15, 0, 2)
    assert FEED not in vehicle.packets(9, 1)
    server.call("/cf1/takeoff", TAKEOFF)
    for count in range(1, 4):
        server.process.advance(0.2)
        assert vehicle.wait_for(lambda: vehicle.packets(9, 1).count(FEED) >= count)  # noqa: B023


def test_no_other_vehicle_has_a_watchdog(server, vehicle):
    server.call("/cf1/takeoff", TAKEOFF)
    server.process.advance(2.0)
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 2)
    assert FEED not in vehicle.packets(9, 1)


def test_the_status_says_what_state_a_vehicle_is_in(server):
    vehicle = server.make_vehicle()
    adding = server.begin_adding(vehicle.uri)
    assert "connecting to udp://" in said(server)
    adding.result(timeout=LIMIT)
    wait_for_words(server, "ready: armed")
    is_(vehicle, 0b11010)
    wait_for_words(server, "flying: on high-level commands")
    # Sooner, references may be a stream from before.
    server.process.advance(1.5)
    position(server)
    wait_for_words(server, "flying: on setpoints")
    is_(vehicle, 1 << 6)
    wait_for_words(server, "cannot fly: locked; restart the vehicle")


def test_a_callback_that_takes_its_time_loses_no_link(server, vehicle):
    """Packets over the link are still received, including replies to commands."""
    vehicle.wait_for_packets(15, 0)
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    written = []

    def block():
        # Ten pings are a second.
        vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 10)
        written.append(crazyflie.parameters.write("ring.effect", 9))

    server.process.executor.submit(block)
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 2)
    assert written == [9]
    assert server.process.logged("error") == []
