"""A vehicle that is added while a node streams, as after an emergency or a change of battery."""

import pytest
from conftest import result
from safety_helpers import (
    HIGH_LEVEL,
    READY,
    TAKEOFF,
    is_,
    position,
    said,
    thrust,
    wait_for_words,
)
from std_srvs.srv import SetBoolRequest

from crazyflie_driver.msg import Position
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.peer import wait_until

PERIOD = 0.02
FULL_THRUST = 56000.0
UNARMED = 0x1  #: It can be armed.


def full_thrust(server):
    thrust(server, FULL_THRUST)


def stream(server, send, duration):
    for _ in range(round(duration / PERIOD)):
        server.process.advance(PERIOD)
        send(server)


def add(server, vehicle):
    """Add a vehicle, to which nothing has been sent."""
    result(server.begin_adding(vehicle.uri))


def add_while_streaming(server, vehicle, send):
    """Add a vehicle while setpoints come all the time, and for 3 s after that."""
    added = server.begin_adding(vehicle.uri)

    def is_added_after_next():
        server.process.advance(PERIOD)
        if "/cf1/cmd_vel" in server.process.transport.subscribers:
            send(server)
        return added.done()

    wait_until(is_added_after_next, "the vehicle", period=0.002)
    stream(server, send, 3.0)


@pytest.fixture
def standing(server):
    """Return a vehicle on the ground, which has not been added yet."""
    vehicle = server.make_vehicle()
    is_(vehicle, READY)
    return vehicle


def flown(vehicle):
    """Return the setpoints with thrust, or with a reference, that have come so far."""
    # What was sent before is there when the next pings are answered.
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 2)
    thrusts = [data for data in vehicle.packets(3, 0) if data[12:] != b"\0\0"]
    return thrusts + vehicle.packets(7, 0)


def arming(vehicle):
    """Return the requests to arm or disarm that have come."""
    return [data for data in vehicle.packets(9, 1) if data[:1] == b"\x01"]


@pytest.mark.parametrize("send", [full_thrust, position])
def test_a_stream_from_before_does_not_start_a_vehicle_that_is_added(server, standing, send):
    add_while_streaming(server, standing, send)
    assert flown(standing) == []
    assert "setpoints are ignored" in said(server)
    assert any("since before the vehicle was added" in w for w in server.process.logged("warn"))


@pytest.mark.parametrize("send", [full_thrust, position])
def test_nor_one_that_is_removed_and_added_again(server, standing, send):
    """Its battery is changed meanwhile, and it is in a hand."""
    add(server, standing)
    thrust(server, 0.0)
    stream(server, send, 1.0)
    assert flown(standing)
    server.remove(standing.uri)
    standing.received.clear()
    add_while_streaming(server, standing, send)
    assert flown(standing) == []


def test_zero_thrust_of_the_stream_lets_it_pass(server, standing):
    add_while_streaming(server, standing, full_thrust)
    thrust(server, 0.0)
    full_thrust(server)
    assert len(flown(standing)) == 1


def test_a_pause_lets_references_pass_but_no_thrust(server, standing):
    """Thrust that does not begin at zero is a leap, whenever it begins."""
    add_while_streaming(server, standing, full_thrust)
    server.process.advance(1.5)
    full_thrust(server)
    assert flown(standing) == []
    server.process.advance(1.5)
    position(server)
    assert len(flown(standing)) == 1


def test_a_call_lets_no_stream_from_before_pass(server, standing):
    add_while_streaming(server, standing, full_thrust)
    server.call("/cf1/takeoff", TAKEOFF)
    stream(server, full_thrust, 3.0)
    assert flown(standing) == []


@pytest.mark.parametrize(
    ("service", "request_"), [("arm", SetBoolRequest(True)), ("takeoff", TAKEOFF)]
)
def test_thrust_after_a_call_begins_at_zero_until_the_vehicle_flies(
    server, standing, service, request_
):
    add(server, standing)
    server.call(f"/cf1/{service}", request_)
    server.process.advance(1.5)
    stream(server, full_thrust, 0.5)
    assert flown(standing) == []
    assert any("has not reported a flight" in w for w in server.process.logged("warn"))
    # It flies by the planner now: thrust takes it over.
    is_(standing, HIGH_LEVEL)
    wait_for_words(server, "flying")
    server.process.advance(1.5)
    full_thrust(server)
    assert len(flown(standing)) == 1


def test_references_that_begin_on_the_ground_pass_at_once(server, standing):
    """So do scripts that begin as soon as the driver subscribes."""
    add(server, standing)
    for height in (0.0, 0.1, 0.2, 0.3):
        server.process.advance(PERIOD)
        server.process.publish("/cf1/cmd_position", Position(z=height))
    assert flown(standing)


@pytest.mark.parametrize("send", [full_thrust, position])
def test_arming_is_refused_while_setpoints_come(server, standing, send):
    """A brushless vehicle disarms by itself 30 s after it was armed; a takeoff server flies it."""
    is_(standing, UNARMED)
    add(server, standing)
    thrust(server, 0.0)
    stream(server, send, 1.0)
    answer = server.call("/cf1/arm", SetBoolRequest(True))
    assert not answer.success
    assert "setpoints come that would start its motors at once" in answer.message
    with pytest.raises(ServiceError, match="setpoints come that would start its motors at once"):
        server.call("/cf1/takeoff", TAKEOFF)
    assert arming(standing) == []
    # The takeoff server is on the ground again.
    thrust(server, 0.0)
    assert server.call("/cf1/arm", SetBoolRequest(True)).success
    assert len(arming(standing)) == 1


def test_disarming_is_never_refused(server, standing):
    add(server, standing)
    thrust(server, 0.0)
    stream(server, full_thrust, 1.0)
    server.call("/cf1/arm", SetBoolRequest(False))
    assert len(arming(standing)) == 1


@pytest.mark.parametrize("send", [full_thrust, position])
def test_a_stream_does_not_start_a_vehicle_that_was_disarmed_in_it(server, standing, send):
    """Most vehicles arm themselves again within 0.2 s."""
    add(server, standing)
    thrust(server, 0.0)
    stream(server, send, 1.0)
    assert flown(standing)
    server.call("/cf1/arm", SetBoolRequest(False))
    standing.received.clear()
    stream(server, send, 3.0)
    assert flown(standing) == []
    assert any("disarmed" in w for w in server.process.logged("warn"))
    thrust(server, 0.0)
    stream(server, send, 0.1)
    assert flown(standing)


def test_a_vehicle_that_is_disarmed_in_a_stream_is_not_locked_for_its_end(server, standing):
    add(server, standing)
    thrust(server, 0.0)
    stream(server, full_thrust, 1.0)
    standing.received.clear()
    server.call("/cf1/arm", SetBoolRequest(False))
    assert standing.wait_for_packets(7, 1)
