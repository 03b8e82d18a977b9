"""Links end with what they belong to, and within a limit."""

import threading

from cflib.crtp.radiodriver import RadioManager

from crazyflie_py.address import Address
from crazyflie_py.backend import Backend
from crazyflie_py.link import Link

URI = "udp://127.0.0.1:1"


def test_dropping_a_link_does_not_wait_for_a_dongle_that_hangs():
    """Opening one holds a lock of cflib as long as the USB device does not answer."""
    backend = Backend(None, lambda text: None)
    with RadioManager._lock:
        dropping = [threading.Thread(target=backend.drop, daemon=True) for _ in range(2)]
        for thread in dropping:
            thread.start()
        for thread in dropping:
            thread.join(10.0)
            assert not thread.is_alive()


def test_a_link_is_closed_while_its_dongle_hangs():
    link = Link(Address.parse(URI))
    with RadioManager._lock:
        closing = threading.Thread(target=link.close, daemon=True)
        closing.start()
        closing.join(10.0)
        assert not closing.is_alive()
