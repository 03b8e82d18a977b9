"""Services for all vehicles: one packet for those of a channel, and what each needs instead."""

import struct
import threading
from dataclasses import replace

import pytest
import usb
from cflib.crtp.radiodriver import RadioManager
from cflib.drivers import crazyradio
from genpy import Duration
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from safety_helpers import HIGH_LEVEL, LAND, LOCKED, TAKEOFF, is_, stream_position
from std_msgs.msg import Empty
from std_srvs.srv import EmptyRequest, SetBoolRequest

from crazyflie_driver import server_node
from crazyflie_driver.msg import TrajectoryPolynomialPiece
from crazyflie_driver.srv import (
    GoToRequest,
    SetGroupMaskRequest,
    StartTrajectoryRequest,
    StopRequest,
    TakeoffRequest,
    UploadTrajectoryRequest,
)
from crazyflie_link.address import Address
from crazyflie_link.broadcast import REPEATS
from crazyflie_link.testing import Dongle
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.programs import wait_until

ALL = "/crazyflie_server/all/"
GO_TO = GoToRequest(0, True, Point(0.5, 0.0, 0.0), 0.0, Duration(2))


@pytest.fixture
def swarm(server):
    """Return a server with three vehicles, cf1 to cf3, on one channel."""
    vehicles = [server.make_vehicle() for _ in range(3)]
    for number, vehicle in enumerate(vehicles, start=1):
        server.add(vehicle.uri, f"cf{number}")
        vehicle.wait_for_packets(7, 1)
        vehicle.received.clear()
    return server, vehicles


def commands(vehicle):
    """Return the numbers of its high-level commands, to all and to itself."""
    own = list(vehicle.received)
    shared = list(vehicle.broadcasts)
    for each in shared:
        own.remove(each)
    return tuple([data[0] for port, _, data in packets if port == 8] for packets in (shared, own))


def wait_for_broadcasts(vehicles, count=REPEATS):
    for vehicle in vehicles:
        assert vehicle.wait_for(lambda vehicle=vehicle: len(vehicle.broadcasts) >= count)


def test_a_flight_of_all(swarm):
    server, vehicles = swarm
    for name, request in (("takeoff", TAKEOFF), ("go_to", GO_TO), ("land", LAND)):
        server.call(ALL + name, request)
        server.process.advance(0.5)
    wait_for_broadcasts(vehicles, 3 * REPEATS)
    for vehicle in vehicles:
        assert commands(vehicle) == ([7] * REPEATS + [12] * REPEATS + [8] * REPEATS, [])


def test_a_takeoff_that_one_refuses_is_sent_to_none(swarm):
    server, vehicles = swarm
    is_(vehicles[1], LOCKED)
    with pytest.raises(
        ServiceError, match="takeoff was sent to no vehicle: 1 of 3 .*cf2: .*locked"
    ):
        server.call(ALL + "takeoff", TAKEOFF)
    assert [commands(vehicle) for vehicle in vehicles] == [([], [])] * 3


def test_a_vehicle_that_misses_the_landing_is_landed_by_itself(swarm):
    server, vehicles = swarm
    server.call(ALL + "takeoff", TAKEOFF)
    vehicles[2].hears_broadcasts = False
    server.process.advance(0.5)
    server.call(ALL + "land", LAND)
    assert all(vehicle.flight.is_landing for vehicle in vehicles)
    assert commands(vehicles[2])[1] == [8]


def test_a_takeoff_that_was_too_late_is_not_sent_after_its_refusal(swarm, monkeypatch):
    server, vehicles = swarm
    monkeypatch.setattr(server_node, "ANSWER_LIMIT", 2.0)
    driven, free = server.node._vehicles[vehicles[0].uri], threading.Event()
    check = driven.commands.check

    def check_and_upload(command):
        checked = check(command)
        driven.jobs.submit("an upload", lambda _: driven.handle.outside(free.wait, 60.0))
        return checked

    monkeypatch.setattr(driven.commands, "check", check_and_upload)
    with pytest.raises(ServiceError, match="takeoff: 1 of 3 vehicles: cf1: no answer within 2 s"):
        server.call(ALL + "takeoff", TAKEOFF)
    free.set()
    # A later call, which is answered after those before it.
    server.call("/cf1/arm", SetBoolRequest(True))
    assert [vehicle.flight.starts for vehicle in vehicles] == [0, 1, 1]
    assert commands(vehicles[0]) == ([], [])


def test_a_vehicle_that_cannot_be_landed_is_named(swarm):
    server, vehicles = swarm
    server.call(ALL + "takeoff", TAKEOFF)
    server.process.advance(0.5)
    vehicles[0].hears_broadcasts = False
    vehicles[0].deaf.add((8, 0, b"\x08"))
    with pytest.raises(ServiceError, match="land: 1 of 3 vehicles: cf1: .*not replied"):
        server.call(ALL + "land", LAND)
    assert all(vehicle.flight.is_landing for vehicle in vehicles[1:])


def test_a_landing_does_not_start_a_vehicle_on_the_ground(swarm):
    server, vehicles = swarm
    for number in (1, 2):
        server.call(f"/cf{number}/takeoff", TAKEOFF)
    server.process.advance(0.5)
    server.call(ALL + "land", LAND)
    assert [vehicle.flight.starts for vehicle in vehicles] == [1, 1, 0]
    assert [commands(vehicle) for vehicle in vehicles] == [([], [7, 8])] * 2 + [([], [])]


@pytest.fixture
def add_radios(monkeypatch):
    """Return a function that adds vehicles on channel 30, cf1 and so on, by dongles 0 and 1."""

    def add(server, *uris):
        vehicles = [server.make_vehicle() for _ in uris]
        dongles = []
        for name in ("0", "1"):
            # A dongle speaks to its own vehicles, and its broadcasts reach all.
            ids = [int(uri[-2:], 16) + 0x80 * (uri.split("/")[2] != name) for uri in uris]
            dongles.append(Dongle({(30, i): v.port for i, v in zip(ids, vehicles, strict=True)}))
        monkeypatch.setattr(crazyradio, "_find_devices", lambda serial=None: dongles)
        for number, (uri, vehicle) in enumerate(zip(uris, vehicles, strict=True), start=1):
            server.add(uri, f"cf{number}")
            vehicle.wait_for_packets(7, 1)
            vehicle.received.clear()
        return vehicles

    monkeypatch.setattr(usb.util, "dispose_resources", lambda device: None)
    monkeypatch.setattr(RadioManager, "_radios", [])
    return add


FIRST_TWO = ("radio://0/30/2M/E7E7E7E701", "radio://0/30/2M/E7E7E7E702")
ELSEWHERE = pytest.mark.parametrize(
    "third", ["radio://1/30/2M/E7E7E7E703", "radio://0/030/2M/E7E7E7E703"]
)
"""Addresses on the channel of ``radio://0/30/2M`` that look as if they were on another one."""


@ELSEWHERE
def test_a_landing_does_not_start_a_vehicle_of_another_dongle(server, add_radios, third):
    """It would land a third time, on the ground: in a hand, or with its link lost."""
    vehicles = add_radios(server, *FIRST_TWO, third)
    for number in (1, 2):
        server.call(f"/cf{number}/takeoff", TAKEOFF)
    server.process.advance(0.5)
    server.call(ALL + "land", LAND)
    assert [commands(vehicle) for vehicle in vehicles] == [([], [7, 8])] * 2 + [([], [])]
    assert [vehicle.flight.starts for vehicle in vehicles] == [1, 1, 0]


@ELSEWHERE
def test_one_broadcast_is_for_the_vehicles_of_all_dongles(server, add_radios, third):
    vehicles = add_radios(server, *FIRST_TWO, third)
    server.call(ALL + "takeoff", TAKEOFF)
    wait_for_broadcasts(vehicles)
    assert [commands(vehicle) for vehicle in vehicles] == [([7] * REPEATS, [])] * 3


def test_poses_with_an_id_of_two_vehicles_are_not_packed(make_server, add_radios):
    server = make_server({"broadcast/poses": 2})
    vehicles = add_radios(server, *FIRST_TWO, "radio://1/30/2M/E7E7E7E802")
    for number in (1, 2, 3):
        pose = Pose(Point(1.0 * number, 2.0, 0.5), Quaternion(0, 0, 0, 1))
        server.process.publish(f"/cf{number}/external_pose", PoseStamped(pose=pose))
    for number, vehicle in zip((2, 3), vehicles[1:], strict=True):
        # Its own, and that of cf1, packed alone.
        poses = vehicle.wait_for_packets(6, 1, 2)
        (own,) = [struct.unpack_from("<f", data, 1)[0] for data in poses if data[0] == 8]
        assert own == 1.0 * number
        assert [(data[1], len(data)) for data in poses if data[0] == 9] == [(1, 12)]


def test_poses_of_another_dongle_are_its_own(make_server, add_radios):
    server = make_server({"broadcast/poses": 2})
    vehicles = add_radios(server, *FIRST_TWO, "radio://1/30/2M/E7E7E7E703")
    for number in (1, 2, 3):
        pose = Pose(Point(1.0 * number, 2.0, 0.5), Quaternion(0, 0, 0, 1))
        server.process.publish(f"/cf{number}/external_pose", PoseStamped(pose=pose))
    (packed,) = vehicles[0].wait_for_packets(6, 1)
    assert (packed[0], packed[1], packed[12], len(packed)) == (9, 1, 2, 23)
    own = vehicles[2].wait_for_packets(6, 1, 2)
    assert sorted(data[0] for data in own) == [8, 9]


def test_one_that_flies_on_setpoints_is_told_that_they_stop(swarm):
    server, vehicles = swarm
    is_(vehicles[0], 0x21E)
    stream_position(server, vehicles[0])
    for vehicle in vehicles[1:]:
        is_(vehicle, HIGH_LEVEL)
    server.call(ALL + "go_to", GO_TO)
    assert [commands(vehicle) for vehicle in vehicles] == [([], [12])] * 3
    assert [(port, channel) for port, channel, _ in vehicles[0].received if port in (7, 8)][
        -2:
    ] == [
        (7, 1),
        (8, 0),
    ]


def test_groups(swarm):
    server, vehicles = swarm
    for number, mask in ((1, 1), (2, 1), (3, 2)):
        server.call(f"/cf{number}/set_group_mask", SetGroupMaskRequest(mask))
    server.call(ALL + "takeoff", TakeoffRequest(1, 1.0, Duration(2)))
    wait_for_broadcasts(vehicles)
    assert [vehicle.flight.starts for vehicle in vehicles] == [1, 1, 0]
    server.process.advance(0.5)
    server.call(ALL + "stop", StopRequest(1))
    assert not any(vehicle.flight.motors_run for vehicle in vehicles)


def test_a_trajectory_that_one_does_not_have(swarm):
    server, vehicles = swarm
    piece = TrajectoryPolynomialPiece(duration=Duration(1))
    for number in (1, 2, 3):
        with pytest.raises(ServiceError, match="was sent to no vehicle: .*has not been uploaded"):
            server.call(ALL + "start_trajectory", StartTrajectoryRequest(0, 5, 1.0, False, True))
        server.call(f"/cf{number}/upload_trajectory", UploadTrajectoryRequest(5, 0, [piece]))
    server.call(ALL + "start_trajectory", StartTrajectoryRequest(0, 5, 1.0, False, True))
    wait_for_broadcasts(vehicles)
    assert {13} == {each for vehicle in vehicles for each in commands(vehicle)[0]}


@pytest.mark.parametrize("by_topic", [True, False])
def test_an_emergency_is_broadcast_and_sent_to_each(swarm, by_topic):
    server, vehicles = swarm
    if by_topic:
        server.process.publish("/all/emergency", Empty())
    else:
        server.call(ALL + "emergency", EmptyRequest())
    for vehicle in vehicles:
        wait_until(lambda vehicle=vehicle: (9, 1, b"\x03") in vehicle.broadcasts)
        wait_until(lambda vehicle=vehicle: vehicle.packets(9, 1).count(b"\x03") > REPEATS)
    with pytest.raises(ServiceError, match="emergency stop"):
        server.call(ALL + "takeoff", TAKEOFF)


def test_bad_input(swarm):
    server, vehicles = swarm
    with pytest.raises(ServiceError, match="relative is False.*expected True"):
        server.call(ALL + "go_to", GoToRequest(goal=Point(1, 0, 1), duration=Duration(2)))
    with pytest.raises(
        ServiceError, match="3 of 3 vehicles: cf1, cf2, cf3: takeoff: nan is not finite"
    ):
        server.call(ALL + "takeoff", TakeoffRequest(0, float("nan"), Duration(2)))
    assert [commands(vehicle) for vehicle in vehicles] == [([], [])] * 3


def test_without_vehicles(server):
    with pytest.raises(ServiceError, match="none is connected"):
        server.call(ALL + "land", LAND)


def test_poses_are_packed_from_a_number_of_vehicles_on(make_server, monkeypatch):
    server = make_server({"broadcast/poses": 2})
    vehicles = [server.make_vehicle() for _ in range(2)]
    ids = {vehicle.uri: number for number, vehicle in enumerate(vehicles, start=1)}
    parse = Address.parse
    monkeypatch.setattr(Address, "parse", lambda uri: replace(parse(uri), vehicle_id=ids[uri]))

    def publish(number):
        pose = Pose(Point(1.0, 2.0, 0.5), Quaternion(0, 0, 0, 1))
        server.process.publish(f"/cf{number}/external_pose", PoseStamped(pose=pose))

    for number, vehicle in enumerate(vehicles, start=1):
        server.add(vehicle.uri, f"cf{number}")
    publish(1)
    publish(2)
    for vehicle in vehicles:
        (data,) = vehicle.wait_for_packets(6, 1)
        assert (6, 1, data) in vehicle.broadcasts
        # Both in one packet: the type, and 11 bytes each.
        assert (data[0], data[1], data[12], len(data)) == (9, 1, 2, 23)
    server.remove(vehicles[1].uri)
    publish(1)
    assert vehicles[0].wait_for_packets(6, 1, 2)[1][0] == 8
