"""Calls that end a flight badly, or have a vehicle fly unasked."""

import pytest
from genpy import Duration
from geometry_msgs.msg import Point
from safety_helpers import (
    FLYING,
    HIGH_LEVEL,
    LAND,
    READY,
    TAKEOFF,
    is_,
    position,
    said,
    wait_for_words,
)
from std_srvs.srv import EmptyRequest, SetBoolRequest

from crazyflie_driver.srv import GoToRequest, NotifySetpointsStopRequest, StopRequest
from crazyflie_link.address import Address
from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.programs import LIMIT, wait_until


@pytest.fixture
def radio(monkeypatch, server):
    """Return a vehicle that can be restarted, and how often it was."""
    restarts = []
    monkeypatch.setattr(Address, "is_radio", True)
    monkeypatch.setattr(Crazyflie, "reboot", lambda self: restarts.append(self))
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    return vehicle, restarts


@pytest.mark.parametrize("state", [FLYING, HIGH_LEVEL, 0x10E])
def test_a_vehicle_is_not_restarted_in_flight(server, radio, state):
    vehicle, restarts = radio
    is_(vehicle, state)
    with pytest.raises(ServiceError, match="no reboot: the vehicle flies"):
        server.call("/cf1/reboot", EmptyRequest())
    assert restarts == []
    is_(vehicle, READY)
    server.call("/cf1/reboot", EmptyRequest())
    assert len(restarts) == 1


def test_a_vehicle_of_which_nothing_is_known_is_not_restarted(server, radio):
    vehicle, restarts = radio
    vehicle.is_frozen = True
    wait_for_words(server, "lost")
    with pytest.raises(ServiceError, match="no reboot: it is not known .* crazyflie_tools reboot"):
        server.call("/cf1/reboot", EmptyRequest())
    assert restarts == []


@pytest.fixture
def stale(server, vehicle):
    """Return a function that streams; the link was lost, and the vehicle is on the ground."""
    position(server)
    vehicle.wait_for_packets(7, 0)
    vehicle.is_frozen = True

    def stream(until):
        def is_there():
            server.process.advance(0.02)
            position(server)
            return until()

        wait_until(is_there, "a state of the link")

    stream(lambda: "lost" in said(server))
    vehicle.flight.restart()
    vehicle.is_frozen = False
    stream(lambda: "ready" in said(server))
    # Less than a pause of the stream, and more than the age that a state may have.
    server.process.advance(0.5)
    vehicle.received.clear()
    return stream


@pytest.mark.parametrize(
    ("service", "request_"),
    [
        ("arm", SetBoolRequest(False)),
        ("arm", SetBoolRequest(True)),
        ("land", LAND),
        ("stop", StopRequest()),
        ("notify_setpoints_stop", NotifySetpointsStopRequest(0, 0)),
        ("takeoff", TAKEOFF),
        ("go_to", GoToRequest(duration=Duration(1))),
    ],
)
def test_no_call_lets_an_old_stream_pass(server, vehicle, stale, service, request_):
    """It is for the flight before: after a takeoff it would take the vehicle from its planner."""
    server.call(f"/cf1/{service}", request_)
    begin = server.process.clock.time()
    stale(lambda: server.process.clock.time() > begin + 1.0)
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 2)
    assert vehicle.packets(7, 0) == []


def test_a_landing_for_the_battery_that_fails_is_tried_again(server, vehicle):
    server.call("/cf1/takeoff", TAKEOFF)
    server.process.advance(3.0)
    wait_for_words(server, "flying")
    vehicle.deaf.add((8, 0, b"\x08"))
    vehicle.received.clear()
    vehicle.log["pm.vbat"] = ("f", 2.0)
    wait_for_words(server, "battery low")
    server.process.advance(5.0)
    wait_until(lambda: any("land failed" in t for t in server.process.logged("error")), "a failure")
    vehicle.deaf.clear()
    wait_until(lambda: vehicle.flight.is_landing, "a landing")
    assert len([t for t in server.process.logged("error") if "battery critical" in t]) == 1


def loses_replies(vehicle, count):
    """Lose the vehicle's first replies to commands."""
    left = [count]

    def lose(_):
        is_command = vehicle.received[-1][:2] == (8, 0)
        left[0] -= is_command
        return is_command and left[0] >= 0

    vehicle.lose = lose


def test_a_takeoff_whose_reply_is_lost_has_not_failed(server, vehicle):
    loses_replies(vehicle, 1)
    server.call("/cf1/takeoff", TAKEOFF)
    assert [data[0] for data in vehicle.packets(8, 0)] == [7, 7]


def test_a_takeoff_without_any_reply_is_a_success_if_the_vehicle_obeys(make_server):
    server = make_server({"emergency_watchdog": True})
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    loses_replies(vehicle, 100)
    server.call("/cf1/takeoff", TAKEOFF)
    assert any("state shows that it obeys" in text for text in server.process.logged("warn"))
    wait_for_words(server, "flying")
    vehicle.lose = lambda _: False
    server.process.advance(0.4)
    assert server.process.published("/flights")[-1].data == "/crazyflie_server in flight"
    # The emergency watchdog.
    assert b"\x04" in vehicle.wait_for_packets(9, 1)
    server.node.prepare_shutdown()
    wait_until(lambda: vehicle.flight.is_landing, "a landing")


def test_a_takeoff_that_happens_after_its_refusal_is_landed(server, vehicle):
    """Vehicle or computer are busy: what was sent waits, and so do the answers."""
    vehicle.stalls_at = (8, 0, b"\x07")
    with pytest.raises(ServiceError, match="is heard again, it is landed if it obeys"):
        server.call("/cf1/takeoff", TAKEOFF)
    assert not vehicle.flight.motors_run
    vehicle.resume()
    wait_until(lambda: vehicle.flight.is_landing, "a landing")
    errors = server.process.logged("error")
    assert any("refused as not answered is carried out: landing" in text for text in errors)
    server.process.advance(5.0)
    commands = server.node._vehicles[vehicle.uri].commands
    wait_until(lambda: commands._unanswered is None, "the end of it")
    assert vehicle.flight.starts == 1


def test_a_takeoff_without_a_reply_that_was_landed_is_not_landed_again(server, vehicle):
    commands = server.node._vehicles[vehicle.uri].commands
    vehicle.lose = lambda _: vehicle.received[-1][0] == 8 and vehicle.received[-1][2][0] == 7
    takeoff = server.process.call("/cf1/takeoff", TAKEOFF)
    vehicle.wait_for_packets(8, 0)
    wait_until(lambda: vehicle.flight.motors_run, "the takeoff")
    server.process.advance(1.0)
    server.call("/cf1/land", LAND)
    with pytest.raises(ServiceError, match="given up for land"):
        takeoff.result(LIMIT)
    wait_until(lambda: commands._unanswered is None, "a look at the state")
    errors = server.process.logged("error")
    assert not any("is carried out: landing" in text for text in errors)
    assert [data[0] for data in vehicle.packets(8, 0)] == [7, 8]


def test_a_takeoff_that_is_tried_again_is_not_taken_for_the_first_one(server, vehicle):
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    vehicle.deaf.add((8, 0, b"\x07"))
    takeoff = server.process.call("/cf1/takeoff", TAKEOFF)
    vehicle.wait_for_packets(8, 0)
    vehicle.is_frozen = True
    with pytest.raises(ServiceError, match="is heard again, it is landed if it obeys"):
        takeoff.result(LIMIT)
    vehicle.deaf.clear()
    loses_replies(vehicle, 2)
    vehicle.is_frozen = False
    wait_until(lambda: crazyflie.state is LinkState.CONNECTED, "the link's return")
    server.call("/cf1/takeoff", TAKEOFF)
    assert vehicle.flight.starts == 1
    wait_for_words(server, "flying: on high-level commands")
    assert not vehicle.flight.is_landing


def test_a_takeoff_that_does_not_arrive_is_refused_with_the_state(server, vehicle):
    vehicle.deaf.add((8, 0, b"\x07"))
    with pytest.raises(ServiceError, match="not replied within 1 s; .* state is: armed, auto arm"):
        server.call("/cf1/takeoff", TAKEOFF)
    vehicle.deaf.clear()
    # It is over: a flight that another client begins is not landed.
    assert server.node._vehicles[vehicle.uri].commands._unanswered is None
    assert vehicle.flight.starts == 0


def test_a_go_to_without_any_reply(server, vehicle):
    go_to = GoToRequest(relative=True, goal=Point(0.5, 0.0, 0.0), duration=Duration(9))
    server.call("/cf1/takeoff", TAKEOFF)
    server.process.advance(3.0)
    flight = server.node._vehicles[vehicle.uri].flight
    wait_until(flight.is_at_rest, "the end of the takeoff")
    loses_replies(vehicle, 100)
    # One that hovered before flies by this one; another cannot be told from it.
    server.call("/cf1/go_to", go_to)
    with pytest.raises(ServiceError, match="may or may not have been .* state is: .*level active"):
        server.call("/cf1/go_to", go_to)
    assert [data[0] for data in vehicle.packets(8, 0)] == [7, 12, 12]
    assert not vehicle.flight.is_landing


def test_a_vehicle_that_flies_does_not_take_off(server, vehicle):
    server.call("/cf1/takeoff", TAKEOFF)
    server.process.advance(3.0)
    with pytest.raises(ServiceError, match="no takeoff: the vehicle flies"):
        server.call("/cf1/takeoff", TAKEOFF)
    assert len(vehicle.packets(8, 0)) == 1
