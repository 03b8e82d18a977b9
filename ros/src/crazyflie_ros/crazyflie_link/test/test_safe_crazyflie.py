"""cflib's Crazyflie without a vehicle: the folder of its tables, its drivers and its end."""

import queue
import threading
from unittest.mock import MagicMock

import cflib.crtp
import pytest
from cflib.crtp.crtpstack import CRTPPacket
from cflib.crtp.udpdriver import UdpDriver

from crazyflie_link import cflib_internals
from crazyflie_link.cflib_internals import SafeCrazyflie, init_drivers, table_cache
from crazyflie_utils.testing.programs import wait_until

LIMIT = 10.0


def test_tables_are_kept_in_the_user_s_own_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CACHE_HOME")
    folder = tmp_path / ".cache" / "crazyflie_link"
    assert table_cache() == str(folder)
    assert folder.stat().st_mode & 0o777 == 0o700
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
    assert table_cache() == str(tmp_path / "other" / "crazyflie_link")
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert table_cache() is None


def test_drivers_are_known_once(monkeypatch):
    monkeypatch.setattr(cflib.crtp, "CLASSES", [])
    for _ in range(2):
        init_drivers()
        assert cflib.crtp.CLASSES.count(UdpDriver) == 1


@pytest.fixture
def driver():
    """Return a driver whose receiver waits until it is woken."""
    driver = MagicMock(spec=UdpDriver())
    driver.in_queue = queue.Queue()
    driver.socket = MagicMock()
    driver.needs_resending = False
    driver.receive_packet = lambda wait: driver.in_queue.get(timeout=LIMIT)
    return driver


@pytest.fixture
def crazyflie(driver, monkeypatch):
    """Return cflib's Crazyflie on that driver, as it is after its link was opened."""
    monkeypatch.setattr(cflib_internals, "_JOIN_LIMIT", 5.0)
    crazyflie = SafeCrazyflie(None, lambda text: None)
    crazyflie.link = driver
    crazyflie.incoming.start()
    yield crazyflie
    crazyflie.disconnect()


@pytest.mark.parametrize("name", ["udp", "radio"])
def test_over_udp_requests_are_repeated_and_the_receiver_looks_up_soon(crazyflie, driver, name):
    driver.get_name.return_value = name
    crazyflie.link_established.call("")
    assert driver.needs_resending == (name == "udp")
    assert driver.socket.settimeout.called == (name == "udp")


def test_an_error_while_sending_is_reported_unless_the_link_was_closed(driver):
    errors = []
    crazyflie = SafeCrazyflie(None, errors.append)
    crazyflie.link = driver
    driver.send_packet.side_effect = OSError("broken")
    crazyflie.send_packet(CRTPPacket())
    assert len(errors) == 1

    def close(_):
        crazyflie.link = None
        raise OSError("closed")

    driver.send_packet.side_effect = close
    crazyflie.send_packet(CRTPPacket())
    assert len(errors) == 1


def test_a_link_that_was_never_opened_has_an_end():
    crazyflie, ended = SafeCrazyflie(None, lambda text: None), threading.Event()
    crazyflie.disconnected.add_callback(lambda uri: ended.set())
    crazyflie.link_established.call("")
    crazyflie.disconnect()
    assert ended.wait(LIMIT)


def test_a_callback_at_work_ends_before_the_driver_is_closed(crazyflie, driver):
    is_at_work, is_closed, seen = threading.Event(), threading.Event(), []

    def work(_):
        is_at_work.set()
        seen.append(is_closed.wait(0.1))

    crazyflie.packet_received.add_callback(work)
    driver.close.side_effect = is_closed.set
    driver.in_queue.put(CRTPPacket())
    assert is_at_work.wait(LIMIT)
    crazyflie.disconnect()
    assert seen == [False]
    assert is_closed.is_set()
    assert not crazyflie.incoming.is_alive()


def test_the_end_wakes_the_receiver(crazyflie):
    crazyflie.disconnect()
    assert not crazyflie.incoming.is_alive()


def test_a_callback_may_end_its_link(crazyflie, driver):
    crazyflie.packet_received.add_callback(lambda _: crazyflie.disconnect())
    driver.in_queue.put(CRTPPacket())
    wait_until(lambda: driver.close.called, limit=LIMIT)
    wait_until(lambda: not crazyflie.incoming.is_alive(), limit=LIMIT)
