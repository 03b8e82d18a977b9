"""The private names of cflib that are used, and dongles that are dead, unused or do not react."""

import queue
import re
import threading
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest
from cflib.crtp.radiodriver import RadioDriver, RadioManager, _RadioCommands, _SharedRadioInstance
from cflib.crtp.udpdriver import UdpDriver
from cflib.drivers.crazyradio import Crazyradio

import crazyflie_link
from crazyflie_link import cflib_internals
from crazyflie_link.cflib_internals import (
    BROADCAST_ADDRESS,
    PRIVATE_NAMES,
    RadioBroadcast,
    check_private_names,
    forget_dead_radios,
    release,
)

SOURCES = Path(crazyflie_link.__path__[-1])


@pytest.mark.parametrize(
    "name",
    [
        "cflib.crazyflie.log:Log._no_such_table",
        "cflib.crtp.radiodriver:_NoSuchThread._sp",
        "cflib.crtp.radiodriver:RadioManager._no_such_list",
    ],
)
def test_a_name_that_is_gone_is_named_with_the_version_that_has_it(name):
    requirements = next(
        folder / "requirements.txt"
        for folder in SOURCES.resolve().parents
        if (folder / "requirements.txt").is_file()
    )
    (pin,) = re.findall(r"^cflib==.*$", requirements.read_text(encoding="utf-8"), re.MULTILINE)
    with pytest.raises(ImportError) as caught:
        check_private_names([*PRIVATE_NAMES, name])
    assert name.replace(":", ".") in str(caught.value)
    assert str(caught.value).endswith(pin)


def test_all_private_names_in_the_sources_are_listed():
    """Those of cflib's objects; this package's own begin with self or its own names."""
    listed = {name.rpartition(".")[2] for name in PRIVATE_NAMES}
    used = set()
    for file in SOURCES.glob("*.py"):
        text = file.read_text(encoding="utf-8")
        used |= set(re.findall(r"(?:RadioManager|radio|thread|driver|log)\.(_[a-z]\w*)", text))
    assert used
    assert used <= listed


class SharedRadio:
    """cflib's owner of a dongle, with an answer that nobody waits for."""

    def __init__(self, is_alive, dongle):
        self.is_alive = lambda: is_alive
        self._radio, self._rsp_queues, self._lock = dongle, {3: queue.Queue()}, threading.Lock()


def test_dead_dongles_are_closed_and_unused_ones_emptied(monkeypatch):
    dongle = MagicMock()
    dongle.close.side_effect = AttributeError("it was unplugged")
    dead, gone = SharedRadio(False, dongle), SharedRadio(False, None)
    unused, used = SharedRadio(True, None), SharedRadio(True, MagicMock())
    monkeypatch.setattr(RadioManager, "_radios", [None, dead, gone, unused, used])
    forget_dead_radios()
    assert RadioManager._radios == [None, None, None, unused, used]
    dongle.close.assert_called_once_with()
    assert dead._radio is None
    assert (len(unused._rsp_queues), len(used._rsp_queues)) == (0, 1)
    used._radio.close.assert_not_called()


def test_only_links_by_radio_are_released():
    release(UdpDriver())
    driver = RadioDriver()
    release(driver)
    answers = queue.Queue()
    driver._thread, driver._radio = MagicMock(_sp=False), SimpleNamespace(_rsp_queue=answers)
    release(driver)
    assert driver._thread._sp
    assert answers.get_nowait() is None


class Dongles:
    """Users of a dongle, in the place of `RadioManager`, and whether they are answered."""

    def __init__(self):
        self.users, self.is_answering = [], False

    def open(self, devid):
        user = _SharedRadioInstance(5, queue.Queue(), queue.Queue(), 0.53)
        user._cmd_queue.put("another packet")
        if self.is_answering:
            user._rsp_queue.put(None)
            user._rsp_queue.put(None)
        self.users.append(user)
        return user


def test_a_dongle_that_does_not_react_is_opened_again(monkeypatch):
    dongles = Dongles()
    monkeypatch.setattr(RadioManager, "open", dongles.open)
    monkeypatch.setattr(cflib_internals, "_DONGLE_LIMIT", 0.01)
    radio = RadioBroadcast("radio://0/30/2M/E7E7E7E701")
    with pytest.raises(OSError, match="the Crazyradio does not react"):
        radio.transmit([b"x"])
    assert not dongles.users[0]._opened
    dongles.is_answering = True
    for _ in range(2):
        radio.transmit([b"x"])
    _, user = dongles.users
    what = (30, BROADCAST_ADDRESS, Crazyradio.DR_2MPS, [b"x"])
    assert list(user._cmd_queue.queue) == [
        *[(5, _RadioCommands.SEND_PACKET, what)] * 2,
        "another packet",
    ]
    assert user._opened


def test_without_a_dongle_a_broadcast_is_an_error(monkeypatch):
    monkeypatch.setattr(RadioManager, "open", MagicMock(side_effect=Exception("no dongle")))
    with pytest.raises(OSError, match="no dongle"):
        RadioBroadcast("radio://0/30/2M/E7E7E7E701").transmit([b"x"])
