"""A vehicle that is left, or handed over from one kind of command to the other."""

import struct

import pytest
from geometry_msgs.msg import Pose, PoseStamped, Quaternion
from safety_helpers import (
    FLYING,
    HIGH_LEVEL,
    LAND,
    READY,
    TAKEOFF,
    UNLOCKED,
    begin_removing,
    commands,
    is_,
    position,
    thrust,
    wait_for_words,
)
from std_msgs.msg import String
from std_srvs.srv import EmptyRequest

from crazyflie_driver.srv import NotifySetpointsStopRequest
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.peer import wait_until

LIMIT = 60.0
POSE = Pose(orientation=Quaternion(w=1.0))


def test_a_vehicle_on_the_ground_is_left_unlocked(server, vehicle):
    server.remove(vehicle.uri)
    assert commands(vehicle) == UNLOCKED


def test_zeros_after_connecting_lock_nothing(server):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    vehicle.wait_for_packets(7, 1)
    assert commands(vehicle) == UNLOCKED


def test_a_vehicle_that_is_removed_in_flight_lands_first(hovering):
    server, vehicle = hovering
    is_(vehicle, HIGH_LEVEL)
    removing = begin_removing(server, vehicle)
    assert vehicle.packets(3, 0) == []
    is_(vehicle, FLYING)
    removing.join(LIMIT)
    assert commands(vehicle) == [(7, 1), (8, 0), *UNLOCKED]


def test_a_landing_outlives_the_server(hovering):
    """A packet after the landing would stop the motors in the air."""
    server, vehicle = hovering
    is_(vehicle, HIGH_LEVEL)
    server.node.shutdown()
    assert commands(vehicle) == [(7, 1), (8, 0)]


def test_ctrl_c_while_the_link_is_silent_is_a_landing_all_the_same(server, vehicle):
    server.call("/cf1/takeoff", TAKEOFF)
    is_(vehicle, FLYING | HIGH_LEVEL)
    wait_for_words(server, "flying: on high-level commands")
    server.process.advance(0.2)
    assert server.process.published("/flights")[-1].data == "/crazyflie_server in flight"
    vehicle.is_frozen = True
    wait_for_words(server, "lost")
    vehicle.received.clear()
    server.node.prepare_shutdown()
    vehicle.is_frozen = False

    def is_landed():
        server.process.advance(0.1)
        return any(packet[0] == 8 for packet in vehicle.packets(8, 0))

    def has_told():
        server.process.advance(0.1)
        return server.process.published("/flights")[-1].data == "/crazyflie_server on ground"

    wait_until(is_landed, "a landing")
    is_(vehicle, READY)
    wait_until(has_told, "the end of the flight")


@pytest.fixture
def on_thrust(server, vehicle):
    """Return a server and a vehicle that flies on thrust."""
    is_(vehicle, FLYING)
    wait_for_words(server, "flying")
    thrust(server)
    vehicle.wait_for_packets(3, 0)
    vehicle.received.clear()
    return server, vehicle


def test_a_flight_on_thrust_cannot_be_landed_by_the_vehicle(on_thrust):
    server, vehicle = on_thrust
    # The stream has ended.
    server.process.advance(3.0)
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 2)
    vehicle.received.clear()
    server.remove(vehicle.uri)
    assert commands(vehicle) == UNLOCKED


@pytest.mark.parametrize("is_fed", [False, True])
def test_a_vehicle_that_flies_on_thrust_is_not_removed(on_thrust, is_fed):
    server, vehicle = on_thrust
    if is_fed:
        server.process.publish("/cf1/external_pose", PoseStamped(pose=POSE))
    with pytest.raises(ServiceError, match="flies on the thrust of /cf1/cmd_vel.*land first"):
        server.remove(vehicle.uri)
    assert commands(vehicle) == []
    thrust(server, 0.0)
    server.remove(vehicle.uri)


def test_after_an_emergency_it_is_removed_although_its_controls_still_come(on_thrust):
    server, vehicle = on_thrust
    server.call("/cf1/emergency", EmptyRequest())
    thrust(server)
    # The log still says that it flies.
    with pytest.raises(ServiceError, match="is removed, but the emergency stop is not confirmed"):
        server.remove(vehicle.uri)


def test_whoever_flies_a_vehicle_is_asked_to_land_before_the_driver_ends(on_thrust):
    server, vehicle = on_thrust
    server.process.advance(0.2)
    assert server.process.published("/flights")[-1].data == "/crazyflie_server in flight"
    server.node.prepare_shutdown()
    last = server.process.published("/flights")[-1].data
    assert last.splitlines()[-1] == "/crazyflie_server is to end: land"
    # It waits for the end of the stream.
    thrust(server, 0.0)
    server.process.advance(0.2)
    assert server.process.published("/flights")[-1].data == "/crazyflie_server on ground"
    assert len(vehicle.wait_for_packets(3, 0)) == 1


@pytest.mark.parametrize(("node", "lands"), [("/mocap", True), ("/cf1/a", True), ("/b/a", False)])
def test_the_end_of_a_node_lands_the_vehicles_that_need_it(server, vehicle, node, lands):
    server.call("/cf1/takeoff", TAKEOFF)
    is_(vehicle, FLYING | HIGH_LEVEL)
    wait_for_words(server, "flying: on high-level commands")
    server.process.advance(0.2)
    vehicle.received.clear()
    server.process.publish("/flights", String(f"{node} is to end: land"))
    if lands:
        assert vehicle.wait_for_packets(8, 0)[0][0] == 8
        assert (
            "a node that the flight needs is to end: landing" in server.process.logged("error")[-1]
        )
    else:
        vehicle.wait_for_packets(15, 0, 2)
        assert vehicle.packets(8, 0) == []


def test_a_removal_without_a_link_says_what_it_could_not_do(server, vehicle):
    vehicle.is_frozen = True
    wait_for_words(server, "lost")
    with pytest.raises(ServiceError, match="is removed, but its motors could not be stopped"):
        server.remove(vehicle.uri)
    vehicle.is_frozen = False
    server.add(vehicle.uri)


def test_a_link_that_is_lost_during_a_removal_is_a_removal_without_one(server, vehicle):
    vehicle.is_frozen = True
    with pytest.raises(ServiceError, match="is removed, but its motors could not be stopped"):
        server.remove(vehicle.uri)


def test_a_stream_that_ends_at_rest_is_handed_over(server, vehicle):
    """Over UDP the notice is repeated until the vehicle would be locked."""
    for pwm, ends in ((1000.0, 0), (0.0, 3)):
        vehicle.received.clear()
        thrust(server, pwm)
        vehicle.wait_for_packets(3, 0)
        server.process.advance(0.4)
        assert vehicle.packets(7, 1) == []
        server.process.advance(3.0)
        vehicle.wait_for_packets(15, 0, 2)
        assert len(vehicle.packets(7, 1)) == ends


# Handing over.


def test_a_notice_waits_for_its_command(hovering):
    server, vehicle = hovering
    server.call("/cf1/notify_setpoints_stop", NotifySetpointsStopRequest(0, 250))
    vehicle.wait_for_packets(15, 0, 2)
    assert commands(vehicle) == []
    server.call("/cf1/land", LAND)
    assert commands(vehicle) == [(7, 1), (8, 0)]
    assert vehicle.packets(7, 1) == [struct.pack("<BI", 0, 250)]
    server.process.advance(1.0)
    assert not any("notify" in text for text in server.process.logged("warn"))


def test_a_notice_without_a_command_is_not_sent(hovering):
    server, vehicle = hovering
    server.call("/cf1/notify_setpoints_stop", NotifySetpointsStopRequest(0, 0))
    server.process.advance(1.0)
    vehicle.wait_for_packets(15, 0, 2)
    assert commands(vehicle) == []
    assert "notify_setpoints_stop was not sent" in server.process.logged("warn")[-1]


def test_a_setpoint_under_way_does_not_stop_a_landing(hovering):
    server, vehicle = hovering
    server.call("/cf1/land", LAND)
    position(server)
    vehicle.wait_for_packets(15, 0, 2)
    assert commands(vehicle) == [(7, 1), (8, 0)]
