"""cflib's own radio driver on a dongle that fails: a fake of the USB device below it."""

import queue
import socket
import threading
import time

import pytest
import usb
from cflib.crtp.radiodriver import RadioManager
from cflib.drivers import crazyradio

from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_link.errors import NoDongleError
from crazyflie_link.testing.fake_vehicle import FakeVehicle
from crazyflie_utils.testing.waiting import LIMIT, wait_until

# The thread of cflib that ends is what these tests are about.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")

NULL = 0xF3


class Dongle:
    """A USB device that passes packets on to vehicles; each has a channel of its own."""

    bcdDevice = 0x0053  # noqa: N815

    def __init__(self, vehicles):
        self._peers = {channel: vehicle.port for channel, vehicle in vehicles.items()}
        self._sockets = {}
        self._channel = 2
        self._answer = b""
        self.is_broken = False

    def set_configuration(self, number):
        self._check()

    def reset(self):
        self._check()

    def ctrl_transfer(self, kind, request, wValue, wIndex, timeout, data_or_wLength):  # noqa: N803
        self._check()
        if request == crazyradio.SET_RADIO_CHANNEL:
            self._channel = wValue

    def write(self, endpoint, data, timeout):
        self._check()
        port = self._peers.get(self._channel)
        if port is None:
            self._answer = b"\0"
            return
        link = self._sockets.get(self._channel)
        if link is None:
            link = self._sockets[self._channel] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            link.connect(("127.0.0.1", port))
            link.setblocking(False)
        if data[0] & NULL != NULL:
            link.send(bytes(data))
        try:
            self._answer = b"\1" + link.recv(64)
        except BlockingIOError:
            self._answer = b"\1"
            # A real one needs about so long.
            time.sleep(0.001)

    def read(self, endpoint, size, timeout):
        self._check()
        return self._answer

    def _check(self):
        if self.is_broken:
            raise usb.USBError("No such device (it may have been disconnected)", errno=19)


class Bus:
    """A USB bus with one socket for a dongle."""

    def __init__(self, vehicles):
        self._vehicles = vehicles
        self.dongle = None
        self.failed_attempts = 0

    def plug_in(self):
        self.dongle = Dongle(self._vehicles)

    def break_it(self):
        """Have the dongle answer no request any more; it stays plugged in."""
        self.dongle.is_broken = True

    def devices(self, serial=None):
        self.failed_attempts += self.dongle is None
        return [self.dongle] if self.dongle is not None else []


@pytest.fixture
def bus(monkeypatch):
    vehicles = {10: FakeVehicle(), 20: FakeVehicle()}
    bus = Bus(vehicles)
    bus.vehicles = vehicles
    bus.plug_in()
    monkeypatch.setattr(crazyradio, "_find_devices", bus.devices)
    monkeypatch.setattr(usb.util, "dispose_resources", lambda device: None)
    monkeypatch.setattr(RadioManager, "_radios", [])
    yield bus
    for vehicle in vehicles.values():
        vehicle.close()


class Connected:
    """A connection by radio, and the states that it goes through."""

    def __init__(self, channel, cache):
        self.states = queue.Queue()
        self.link = Crazyflie(
            f"radio://0/{channel}/2M/E7E7E7E7E7",
            reconnect=True,
            on_state=lambda state, text: self.states.put(state),
            cache=str(cache),
        )
        self.link.connect()

    def wait_for(self, state):
        while self.states.get(timeout=LIMIT) is not state:
            pass


@pytest.fixture
def connected(bus, tmp_path):
    both = [Connected(channel, tmp_path) for channel in bus.vehicles]
    yield both
    for each in both:
        each.link.close()


def assert_emergency_arrives(bus, connected):
    for vehicle, each in zip(bus.vehicles.values(), connected, strict=True):
        vehicle.received.clear()
        each.link.supervisor.emergency_stop()
        assert vehicle.wait_for_packets(9, 1, limit=LIMIT)


def test_two_vehicles_share_a_dongle(bus, connected):
    assert_emergency_arrives(bus, connected)


@pytest.mark.parametrize("is_absent", [False, True])
def test_a_usb_error_ends_no_vehicle_for_good(bus, connected, is_absent):
    """With `is_absent`, attempts to connect again fail before the dongle is plugged in again."""
    bus.break_it()
    if is_absent:
        bus.dongle = None
    for each in connected:
        each.wait_for(LinkState.LOST)
    if is_absent:
        wait_until(lambda: bus.failed_attempts >= 3)
    bus.plug_in()
    for each in connected:
        each.wait_for(LinkState.CONNECTED)
    assert_emergency_arrives(bus, connected)


def test_it_can_happen_again(bus, connected):
    for _ in range(2):
        bus.break_it()
        for each in connected:
            each.wait_for(LinkState.LOST)
        bus.plug_in()
        for each in connected:
            each.wait_for(LinkState.CONNECTED)
    assert_emergency_arrives(bus, connected)


def test_closing_has_a_limit(bus, connected):
    bus.break_it()
    begin = time.monotonic()
    for each in connected:
        each.link.close()
    assert time.monotonic() - begin < LIMIT / 2.0
    wait_until(lambda: "RadioDriverThread" not in [thread.name for thread in threading.enumerate()])


def test_without_a_dongle_nothing_is_left_behind(bus, tmp_path):
    bus.dongle = None
    for _ in range(3):
        with pytest.raises(NoDongleError):
            Connected(10, tmp_path)
    bus.plug_in()
    again = Connected(10, tmp_path)
    again.link.close()
    again = Connected(10, tmp_path)
    again.link.close()
