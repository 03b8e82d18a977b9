"""Packets to all vehicles of a channel, down to a fake of the radio's USB device."""

import struct
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from cflib.utils.encoding import decompress_quaternion
from usb_bus import PLACES

from crazyflie_link import cflib_internals
from crazyflie_link.address import Address
from crazyflie_link.broadcast import REPEATS, Broadcaster, SharedCommand
from crazyflie_link.cflib_internals import packet
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.localization import PackedPoses, pack
from crazyflie_link.supervisor import BROADCAST_STOP
from crazyflie_utils.testing.programs import LIMIT, wait_until
from crazyflie_virtual.testing import FakeVehicle

# The thread of cflib that ends with the dongle.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")

STATE = (7, 0, b"\0")


@pytest.fixture
def by_radio(bus, tmp_path):
    """Return the vehicles that share a channel, and their links."""
    places = [place for place in PLACES if place[0] == 30]
    links = [
        Crazyflie(f"radio://0/30/2M/E7E7E7E7{last:02X}", cache=str(tmp_path)) for _, last in places
    ]
    for link in links:
        link.connect()
    yield [bus.vehicles[place] for place in places], links
    for link in links:
        link.close()


@pytest.fixture
def broadcaster(by_radio):
    _, links = by_radio
    made = Broadcaster(links[0].address, lambda: [])
    yield made
    made.close()


def test_a_radio_reaches_all_of_the_channel_and_no_other(bus, by_radio, broadcaster):
    vehicles, links = by_radio
    broadcaster.send([packet(*STATE)])
    for vehicle in vehicles:
        assert vehicle.wait_for(lambda vehicle=vehicle: len(vehicle.broadcasts) == REPEATS)
        assert set(vehicle.broadcasts) == {STATE}
    wait_until(lambda: broadcaster.sent == REPEATS)
    assert bus.vehicles[10, 0xE7].received == []
    # The acknowledgement is on again.
    assert links[0].supervisor.read() is not None


def test_an_emergency_goes_to_all(by_radio, broadcaster):
    vehicles, _ = by_radio
    broadcaster.send(BROADCAST_STOP, urgent=True)
    for vehicle in vehicles:
        assert vehicle.wait_for_packets(9, 1)[0] == b"\x03"
        wait_until(lambda vehicle=vehicle: not vehicle.flight.motors_run)


def test_without_a_dongle_a_broadcast_is_given_up(bus, by_radio, broadcaster, caplog):
    bus.break_it()
    bus.dongle = None
    broadcaster.send([packet(*STATE)])
    wait_until(lambda: "a broadcast could not be sent" in caplog.text)


def test_a_shared_command_is_sent_once_to_all(by_radio, broadcaster):
    vehicles, links = by_radio
    errors = begin_together(broadcaster, links, len(links), lambda h: h.take_off(1.0, 2.0))
    assert errors == [None, None]
    command = struct.pack("<BBff?f", 7, 0, 1.0, 0.0, True, 2.0)
    for vehicle in vehicles:
        assert vehicle.flight.starts == 1
        assert vehicle.wait_for(lambda vehicle=vehicle: len(vehicle.broadcasts) == REPEATS)
        assert vehicle.packets(8, 0) == [command] * REPEATS


@pytest.fixture
def by_udp(tmp_path):
    vehicles = [FakeVehicle() for _ in range(3)]
    links = [Crazyflie(vehicle.uri, cache=str(tmp_path)) for vehicle in vehicles]
    for link in links:
        link.connect()
    made = Broadcaster(links[0].address, lambda: [link.link() for link in links])
    yield vehicles, links, made
    made.close()
    for each in (*links, *vehicles):
        each.close()


def begin_together(broadcaster, links, awaited, command):
    """Carry out a command that a number of vehicles share; return their errors."""
    shared = SharedCommand(broadcaster, awaited)
    with ThreadPoolExecutor(len(links)) as pool:
        calls = [pool.submit(command, link.high_level.broadcast(shared)) for link in links]
    return [call.exception() for call in calls]


@pytest.mark.parametrize(
    "command",
    [
        lambda h: h.take_off(1.0, 2.0),
        lambda h: h.go_to((1.0, 0.0, 0.0), 0.0, 2.0, relative=True),
    ],
)
def test_a_vehicle_that_misses_the_broadcast_is_sent_its_own(by_udp, command):
    vehicles, links, broadcaster = by_udp
    vehicles[1].hears_broadcasts = False
    assert begin_together(broadcaster, links, 3, command) == [None] * 3
    assert [len(vehicle.broadcasts) > 0 for vehicle in vehicles] == [True, False, True]
    assert len(vehicles[1].packets(8, 0)) == 1
    assert [vehicle.flight.starts for vehicle in vehicles] == [1, 1, 1]


def test_a_go_to_that_may_be_on_its_way_is_not_repeated(by_udp):
    vehicles, links, broadcaster = by_udp
    vehicles[1].hears_broadcasts = False
    # It flies an earlier plan, which the answer to this one does not tell apart.
    vehicles[1].flight.pin(0x11E)
    errors = begin_together(
        broadcaster, links, 3, lambda h: h.go_to((1.0, 0.0, 0.0), 0.0, 2.0, relative=True)
    )
    assert errors[0] is errors[2] is None
    assert "has not replied" in str(errors[1])
    assert vehicles[1].packets(8, 0) == []


def test_a_broadcast_that_would_come_too_late_is_not_sent(by_udp, caplog):
    """Each vehicle has been sent its own command by then, and would obey twice."""
    vehicles, links, broadcaster = by_udp
    begun, free = threading.Event(), threading.Event()

    def hang():
        begun.set()
        free.wait(60.0)
        return []

    # As a dongle that hangs for a moment; commands go before poses that wait.
    broadcaster.put_latest("poses", hang)
    assert begun.wait(60.0)
    errors = begin_together(
        broadcaster, links, 3, lambda h: h.go_to((1.0, 0.0, 0.0), 0.0, 2.0, relative=True)
    )
    free.set()
    wait_until(lambda: "a broadcast came too late, 0 of 5 sent" in caplog.text)
    assert errors == [None] * 3
    assert [len(vehicle.packets(8, 0)) for vehicle in vehicles] == [1, 1, 1]


def test_a_broadcast_that_a_dongle_has_not_taken_is_withdrawn(bus, by_radio, monkeypatch):
    vehicles, links = by_radio
    monkeypatch.setattr(cflib_internals, "_DONGLE_LIMIT", 0.05)
    begun, free = threading.Event(), threading.Event()
    write = bus.dongle.write

    def hang(*arguments, **named):
        begun.set()
        free.wait(60.0)
        return write(*arguments, **named)

    bus.dongle.write = hang
    assert begun.wait(60.0)
    radio = cflib_internals.RadioBroadcast(links[0].address.uri)
    with pytest.raises(OSError, match="does not react"):
        radio.transmit([bytes([7 << 4, 0])])
    free.set()
    for vehicle in vehicles:
        # A packet that is sent afterwards has arrived.
        vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 2)
        assert vehicle.broadcasts == []


def test_without_one_of_them_each_is_sent_its_own(by_udp):
    vehicles, links, broadcaster = by_udp
    assert begin_together(broadcaster, links[:2], 3, lambda h: h.take_off(1.0, 2.0)) == [None] * 2
    assert [vehicle.broadcasts for vehicle in vehicles] == [[], [], []]
    assert [len(vehicle.packets(8, 0)) for vehicle in vehicles] == [1, 1, 0]


def test_packed_poses():
    attitude = (0.0, 0.6, 0.0, 0.8)
    packets = pack(
        {1: ((1.0, -2.0, 0.5), attitude), 2: ((0, 0, 32.767), None), 255: ((0, 0, 0), attitude)}
    )
    assert [(each.port, each.channel, len(each.data)) for each in packets] == [
        (6, 1, 23),
        (6, 2, 7),
    ]
    kind, number, x, y, z, compressed = struct.unpack_from("<BB3hI", packets[0].data)
    assert (kind, number, x, y, z) == (9, 1, 1000, -2000, 500)
    assert decompress_quaternion(compressed) == pytest.approx(attitude, abs=2e-3)
    assert packets[0].data[12] == 255
    assert struct.unpack("<B3h", packets[1].data) == (2, 0, 0, 32767)


def test_the_packets_of_twenty_vehicles():
    pose, position = ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0)), ((0.0, 0.0, 1.0), None)
    assert len(pack({i: pose for i in range(20)})) == 10
    assert len(pack({i: position for i in range(20)})) == 5


def test_poses_of_a_frame_go_out_together(by_radio, broadcaster):
    vehicles, links = by_radio
    poses = PackedPoses(broadcaster)
    poses.vehicles = 2
    for link in links:
        link.localization.broadcast_by(poses, link.address.vehicle_id)
        link.localization.pose((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 2.0))
    for vehicle in vehicles:
        (data,) = vehicle.wait_for_packets(6, 1)
        assert (data[0], data[1], data[12]) == (9, 1, 2)
    # One that does not fit in 16 bits of mm goes alone.
    links[0].localization.position(40.0, 0.0, 0.0)
    assert vehicles[0].wait_for_packets(6, 0) == [struct.pack("<fff", 40.0, 0.0, 0.0)]


def test_an_emergency_right_behind_a_pose_stops_no_later_poses(by_radio, broadcaster):
    vehicles, links = by_radio
    poses = PackedPoses(broadcaster)
    poses.vehicles = 2
    for link in links:
        link.localization.broadcast_by(poses, link.address.vehicle_id)
    may_go_on = threading.Event()
    is_held = threading.Event()

    def hold():
        is_held.set()
        may_go_on.wait(LIMIT)
        return []

    # Something else is being sent while pose and emergency come.
    broadcaster.put_latest("test", hold)
    assert is_held.wait(LIMIT)
    links[0].localization.position(1.0, 2.0, 3.0)
    broadcaster.send(BROADCAST_STOP, urgent=True)
    may_go_on.set()
    for link in links:
        link.localization.position(1.0, 2.0, 3.0)
    for vehicle in vehicles:
        vehicle.wait_for_packets(6, 2)


@pytest.mark.parametrize(
    ("uri", "channel", "vehicle_id"),
    [
        ("radio://0/25/2M/E7E7E7E701", "25/2M", 1),
        ("radio://1/025/2M/E7E7E7E701?rate_limit=100", "25/2M", 1),
        ("radio://0/25/1M/E7E7E7E701", "25/1M", 1),
        ("radio://0/25/2M", "25/2M", 0xE7),
        ("udp://127.0.0.1:19850", "udp", None),
        ("usb://0", "usb://0", None),
    ],
)
def test_channels_of_addresses(uri, channel, vehicle_id):
    address = Address.parse(uri)
    assert (address.channel, address.vehicle_id) == (channel, vehicle_id)
