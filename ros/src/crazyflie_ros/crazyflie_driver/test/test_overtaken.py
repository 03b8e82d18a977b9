"""Commands that were cancelled for an urgent one are not sent after it."""

import threading

import pytest
from genpy import Duration
from safety_helpers import LAND, TAKEOFF, is_
from std_srvs.srv import EmptyRequest

from crazyflie_driver.msg import TrajectoryPolynomialPiece
from crazyflie_driver.srv import GoToRequest, StopRequest, UploadTrajectoryRequest
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.programs import wait_until

LIMIT = 60.0

DISARMED, REARMING = 0x201, 0x206
"""The second for 0.16 s, 3 s after a landing: a takeoff waits."""


@pytest.mark.parametrize(("service", "request_"), [("land", LAND), ("stop", StopRequest())])
def test_a_takeoff_that_waits_until_the_vehicle_is_ready(server, vehicle, service, request_):
    is_(vehicle, REARMING)
    takeoff = server.process.call("/cf1/takeoff", TAKEOFF)
    vehicle.wait_for_packets(9, 0, 2)
    server.call(f"/cf1/{service}", request_)
    is_(vehicle, None)
    with pytest.raises(ServiceError, match=f"given up for {service}"):
        takeoff.result(LIMIT)
    assert 7 not in [data[0] for data in vehicle.packets(8, 0)]
    assert not vehicle.flight.motors_run


def test_a_takeoff_of_all_that_arms_a_vehicle_which_is_landed(server, vehicle):
    """The command, which is sent after the check, would follow the landing."""
    is_(vehicle, DISARMED)
    vehicle.deaf.add((9, 1, b"\x01"))
    takeoff = server.process.call("/crazyflie_server/all/takeoff", TAKEOFF)
    vehicle.wait_for_packets(9, 1)
    server.call("/cf1/land", LAND)
    is_(vehicle, None)
    vehicle.send(9, 1, b"\x81\x01\x01")
    with pytest.raises(ServiceError, match="sent to no vehicle.* given up for land"):
        takeoff.result(LIMIT)
    assert vehicle.packets(8, 0) == []


def test_a_takeoff_of_all_that_arms_another_vehicle(server, vehicle):
    """One that has been checked, and is landed meanwhile, would take off after the landing."""
    other = server.make_vehicle()
    server.add(other.uri, "cf2")
    is_(other, DISARMED)
    other.deaf.add((9, 1, b"\x01"))
    takeoff = server.process.call("/crazyflie_server/all/takeoff", TAKEOFF)
    other.wait_for_packets(9, 1)
    server.call("/cf1/land", LAND)
    is_(other, None)
    other.send(9, 1, b"\x81\x01\x01")
    with pytest.raises(ServiceError, match="sent to no vehicle.* cf1: given up for land"):
        takeoff.result(LIMIT)
    assert vehicle.packets(8, 0) == other.packets(8, 0) == []


PIECE = TrajectoryPolynomialPiece([0.0] * 8, [0.0] * 8, [0.0] * 8, [0.0] * 8, Duration(1))


@pytest.mark.parametrize(
    ("service", "request_", "unanswered"),
    [
        ("takeoff", TAKEOFF, (9, 1, b"\x01")),
        ("upload_trajectory", UploadTrajectoryRequest(1, 0, [PIECE]), (4, 2, b"")),
    ],
)
def test_the_reason_of_what_is_held_back_is_the_landing(
    server, vehicle, service, request_, unanswered
):
    is_(vehicle, DISARMED)
    vehicle.deaf.add(unanswered)
    held_back = server.process.call(f"/cf1/{service}", request_)
    vehicle.wait_for_packets(*unanswered[:2])
    server.call("/cf1/land", LAND)
    with pytest.raises(ServiceError, match="^given up for land$"):
        held_back.result(LIMIT)
    assert f"/crazyflie_server: cf1: {service} failed: given up for land" in (
        server.process.logged("error")
    )


@pytest.mark.parametrize("service", ["stop", "emergency"])
def test_a_takeoff_that_waits_to_be_sent(server, vehicle, service):
    """The radio may block the thread that sends for 2 s."""
    begun, free = threading.Event(), threading.Event()

    def block():
        begun.set()
        free.wait(LIMIT)

    vehicle.answers[9, 0, 0x0C] = b"\x8c\x01\x00"
    link = server.node._vehicles[vehicle.uri].crazyflie.link()
    # While the takeoff waits to be armed, and its packets wait.
    vehicle.deaf.add((9, 1, b"\x01"))
    takeoff = server.process.call("/cf1/takeoff", TAKEOFF)
    vehicle.wait_for_packets(9, 1)
    link.put(block)
    assert begun.wait(LIMIT)
    vehicle.send(9, 1, b"\x81\x01\x01")
    # The takeoff is the next packet, and has not been sent.
    wait_until(lambda: link._transmission._commands, "the takeoff's packet")
    request = EmptyRequest() if service == "emergency" else StopRequest()
    urgent = threading.Thread(target=server.call, args=(f"/cf1/{service}", request))
    urgent.start()
    wait_until(lambda: len(link._transmission._commands) >= 2, "the urgent packet")
    free.set()
    urgent.join(LIMIT)
    with pytest.raises(ServiceError, match="given up for"):
        takeoff.result(LIMIT)
    assert 7 not in [data[0] for data in vehicle.packets(8, 0)]
    assert not vehicle.flight.motors_run


def test_a_hand_over_is_not_sent_without_its_command(hovering):
    server, vehicle = hovering
    begun, free = threading.Event(), threading.Event()

    def block():
        begun.set()
        free.wait(LIMIT)

    driven = server.node._vehicles[vehicle.uri]
    link = driven.crazyflie.link()
    link.put(block)
    assert begun.wait(LIMIT)
    vehicle.received.clear()
    go_to = server.process.call("/cf1/go_to", GoToRequest(duration=Duration(1)))
    wait_until(lambda: link._transmission._commands, "the packet")
    driven.jobs.supersede("something else")
    free.set()
    with pytest.raises(ServiceError, match="given up for something else"):
        go_to.result(LIMIT)
    assert vehicle.packets(7, 1) == vehicle.packets(8, 0) == []
    assert driven.setpoints.is_streaming
