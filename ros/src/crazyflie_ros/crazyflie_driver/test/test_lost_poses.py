"""External poses that stop while a vehicle flies by its own estimate of them."""

import math
import threading

import pytest
from genpy import Duration
from geometry_msgs.msg import Point, PointStamped
from safety_helpers import (
    FLYING,
    HIGH_LEVEL,
    LAND,
    READY,
    TAKEOFF,
    commands,
    is_,
    position,
    thrust,
    wait_for_words,
)

from crazyflie_driver.positioning import PoseAgreement
from crazyflie_driver.srv import GoToRequest
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.peer import wait_until

_PERIOD = 0.05
#: Where the vehicle estimates itself (`conftest.LOG`).
_POINT = PointStamped(point=Point(1.5, -2.5, 0.75))


def pass_time(server, duration, fed=True, stream=None):
    """Advance time; the vehicle is sent poses and logs its state meanwhile."""
    log = server.node._vehicles[next(iter(server.node._vehicles))].log
    end = server.process.clock.time() + duration
    while server.process.clock.time() < end:
        if fed:
            server.process.publish("/cf1/external_position", _POINT)
        if stream is not None:
            stream(server)
        state_came = threading.Event()
        log._state_news._awaited.append(state_came)
        # A state is logged every 0.1 s.
        for _ in range(2):
            server.process.advance(_PERIOD)
        wait_until(state_came.is_set, "the log")


def landings(vehicle):
    return [packet for packet in vehicle.packets(8, 0) if packet[0] == 8]


def said(server):
    return [text for text in server.process.logged("error") if "external poses" in text]


@pytest.fixture
def fed(server, vehicle):
    """Return a server and a vehicle that has taken off by external poses."""
    pass_time(server, 1.0)
    server.call("/cf1/takeoff", TAKEOFF)
    is_(vehicle, FLYING | HIGH_LEVEL)
    wait_for_words(server, "flying: on high-level commands")
    pass_time(server, 1.5)
    vehicle.received.clear()
    return server, vehicle


def test_a_flight_whose_external_poses_stop_is_landed(fed):
    server, vehicle = fed
    pass_time(server, 0.3, fed=False)
    assert landings(vehicle) == []
    pass_time(server, 0.5, fed=False)
    wait_until(lambda: landings(vehicle), "a landing")
    (text,) = said(server)
    assert "external poses have not come for 0.5 s: landing" in text
    # Poses that come back do not make a flight of it again.
    with pytest.raises(ServiceError, match="no go_to: external poses have not come"):
        server.call("/cf1/go_to", GoToRequest(duration=Duration(1)))
    is_(vehicle, READY)
    pass_time(server, 1.0)
    server.call("/cf1/takeoff", TAKEOFF)


def test_poses_that_stop_for_a_moment_end_no_flight(fed):
    server, vehicle = fed
    for _ in range(3):
        # 0.4 s, in steps of 0.1 s.
        pass_time(server, 0.35, fed=False)
        pass_time(server, 0.05)
    assert landings(vehicle) == []


def test_poses_that_the_link_refuses_have_stopped(fed):
    server, vehicle = fed
    point = PointStamped(point=Point(x=float("nan")))
    pass_time(
        server,
        0.8,
        fed=False,
        stream=lambda server: server.process.publish("/cf1/external_position", point),
    )
    wait_until(lambda: landings(vehicle), "a landing")


def test_poses_that_jump_in_flight_are_not_sent_and_have_stopped(fed):
    """Motion capture has taken another body for the vehicle, which would dart there."""
    server, vehicle = fed
    before = len(vehicle.packets(6, 0))
    far = PointStamped(point=Point(_POINT.point.x + 2.0, _POINT.point.y, _POINT.point.z))
    pass_time(
        server,
        0.8,
        fed=False,
        stream=lambda server: server.process.publish("/cf1/external_position", far),
    )
    wait_until(lambda: landings(vehicle), "a landing")
    assert len(vehicle.packets(6, 0)) == before
    assert any("it jumps by 2.00 m in flight" in text for text in server.process.logged("warn"))
    # On the ground it may be put anywhere.
    is_(vehicle, READY)
    wait_for_words(server, "ready")
    server.process.publish("/cf1/external_position", far)
    vehicle.wait_for_packets(6, 0, before + 1)


def test_poses_of_a_fast_vehicle_do_not_jump():
    poses = PoseAgreement()
    for step in range(50):
        assert poses.jump(0.1 * step, (0.4 * step, 0.0, 0.0), True) == 0.0
    # After a pause, or a loss, it may be at most 1.3 m further.
    assert poses.jump(6.0, (20.8, 0.0, 0.0), True) == 0.0
    assert poses.jump(6.01, (21.2, 0.0, 0.0), True) == pytest.approx(0.4)
    assert poses.jump(7.0, (30.0, 0.0, 0.0), True) == pytest.approx(9.2)
    assert poses.jump(8.0, (math.nan, 0.0, 0.0), True) == 0.0
    assert poses.jump(8.1, (21.0, 0.0, 0.0), True) == 0.0
    assert poses.jump(8.2, (30.0, 0.0, 0.0), False) == 0.0
    assert poses.jump(8.3, (30.1, 0.0, 0.0), True) == 0.0


def test_a_flight_on_references_whose_external_poses_stop_is_landed(server, vehicle):
    is_(vehicle, FLYING)
    wait_for_words(server, "flying")
    pass_time(server, 1.2, stream=position)
    vehicle.received.clear()
    pass_time(server, 0.8, fed=False, stream=position)
    wait_until(lambda: landings(vehicle), "a landing")


@pytest.mark.parametrize("duration", [0.0, 0.4])
def test_a_few_poses_are_no_stream(server, vehicle, duration):
    """A vehicle with a deck may be told where it stands, and flies on without poses."""
    server.process.publish("/cf1/external_position", _POINT)
    pass_time(server, duration)
    server.call("/cf1/takeoff", TAKEOFF)
    is_(vehicle, FLYING | HIGH_LEVEL)
    wait_for_words(server, "flying: on high-level commands")
    pass_time(server, 2.0, fed=False)
    assert landings(vehicle) == []


def test_a_flight_on_thrust_is_landed_by_its_sender(server, vehicle):
    is_(vehicle, FLYING)
    wait_for_words(server, "flying")
    pass_time(server, 1.2, stream=thrust)
    vehicle.received.clear()
    pass_time(server, 1.0, fed=False, stream=thrust)
    assert landings(vehicle) == []
    assert (7, 1) not in commands(vehicle)


def test_a_flight_that_began_without_poses_needs_none(server, vehicle):
    pass_time(server, 1.2)
    pass_time(server, 0.8, fed=False)
    server.call("/cf1/takeoff", TAKEOFF)
    is_(vehicle, FLYING | HIGH_LEVEL)
    wait_for_words(server, "flying: on high-level commands")
    pass_time(server, 1.0, fed=False)
    assert landings(vehicle) == []
    server.call("/cf1/land", LAND)


def test_poses_are_lost_after_half_a_second():
    poses = PoseAgreement()
    for step in range(11):
        poses.pose(10.0 + 0.1 * step, (0.0, 0.0, 0.0))
    assert not poses.is_lost(11.5, 10.5)
    assert poses.is_lost(11.51, 10.5)
    # They stopped just as the flight began; or before.
    assert poses.is_lost(12.0, 11.4)
    assert not poses.is_lost(12.0, 11.6)
