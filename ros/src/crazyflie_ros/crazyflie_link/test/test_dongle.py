"""cflib's own radio driver on a dongle that fails: a fake of the USB device below it."""

import queue
import threading
import time

import pytest
from usb_bus import PLACES

from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_link.errors import NoDongleError
from crazyflie_utils.testing.programs import LIMIT, wait_until

# The thread of cflib that ends is what these tests are about.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")


class Connected:
    """A connection by radio, and the states that it goes through."""

    def __init__(self, place, cache):
        self.states = queue.Queue()
        channel, address = place
        self.link = Crazyflie(
            f"radio://0/{channel}/2M/E7E7E7E7{address:02X}",
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
    both = [Connected(place, tmp_path) for place in PLACES[:2]]
    yield both
    for each in both:
        each.link.close()


def assert_emergency_arrives(bus, connected):
    for vehicle, each in zip(bus.vehicles.values(), connected, strict=False):
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
            Connected(PLACES[0], tmp_path)
    bus.plug_in()
    again = Connected(PLACES[0], tmp_path)
    again.link.close()
    again = Connected(PLACES[0], tmp_path)
    again.link.close()
