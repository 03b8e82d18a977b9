"""Links end with what they belong to, and within a limit."""

import threading
from unittest.mock import MagicMock, patch

import pytest
from cflib.crtp.radiodriver import RadioManager

from crazyflie_link.address import Address
from crazyflie_link.cflib_internals import SafeCrazyflie
from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_link.errors import LinkLostError
from crazyflie_link.link import Link, LinkHealth
from crazyflie_utils.testing.programs import wait_until

URI = "udp://127.0.0.1:1"
LIMIT = 60.0


@pytest.fixture
def link_class():
    with patch("crazyflie_link.crazyflie.Link", spec=Link) as link_class:
        yield link_class


def test_a_link_that_is_lost_at_the_moment_of_closing_is_closed(link_class):
    """The thread that watches has found out when `close` comes."""
    link = link_class.return_value
    link.cflib = MagicMock()
    states = []
    vehicle = Crazyflie(URI, on_state=lambda state, _: states.append(state))
    taken = threading.Event()

    def fail():
        vehicle.close()
        taken.set()
        return LinkHealth.ENDED, "gone"

    link.health.side_effect = fail
    vehicle.connect()
    assert taken.wait(LIMIT)
    wait_until(lambda: not vehicle._watcher.is_alive(), "the end of the watch")
    link.close.assert_called()
    assert states[-1] is LinkState.DISCONNECTED


def test_a_vehicle_that_is_closed_as_its_link_is_made_does_not_open_it(link_class):
    vehicle = Crazyflie(URI)
    link = link_class.return_value
    link.cflib = MagicMock()

    def make(*_, **__):
        vehicle.close()
        return link

    link_class.side_effect = make
    with pytest.raises(LinkLostError, match="closed"):
        vehicle.connect()
    link.open.assert_not_called()
    link.close.assert_called()
    assert vehicle.state is LinkState.DISCONNECTED


def test_a_vehicle_that_is_closed_as_its_link_is_lost_closes_it_once_and_waits(link_class):
    link = link_class.return_value
    link.cflib = MagicMock()
    link.health.return_value = LinkHealth.ALIVE, "connected"
    vehicle = Crazyflie(URI)
    states = []
    vehicle._on_state = lambda state, _: (
        states.append(state) or (state is LinkState.LOST and vehicle.close())
    )
    vehicle.connect()
    link.health.return_value = LinkHealth.ENDED, "gone"
    wait_until(lambda: not vehicle._watcher.is_alive(), "the end of the watch")
    vehicle.close()
    link.close.assert_called()


def test_ending_a_link_does_not_wait_for_a_dongle_that_hangs():
    """Opening one holds a lock of cflib as long as the USB device does not answer."""
    crazyflie = SafeCrazyflie(None, lambda text: None)
    with RadioManager._lock:
        threads = [threading.Thread(target=crazyflie.disconnect, daemon=True) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(10.0)
            assert not thread.is_alive()


def test_a_link_is_closed_while_its_dongle_hangs():
    link = Link(Address.parse(URI))
    with RadioManager._lock:
        closing = threading.Thread(target=link.close, daemon=True)
        closing.start()
        closing.join(10.0)
        assert not closing.is_alive()
