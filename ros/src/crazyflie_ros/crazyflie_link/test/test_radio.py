"""Functions that need a Crazyradio, on mocks of cflib."""

import itertools
import threading
from types import SimpleNamespace
from unittest.mock import ANY, MagicMock, patch

import cflib.crtp
import pytest
from cflib.crazyflie import Crazyflie as CflibCrazyflie
from cflib.crtp.radiodriver import RadioDriver
from cflib.crtp.udpdriver import UdpDriver
from cflib.utils.power_switch import PowerSwitch

from crazyflie_link import link as module
from crazyflie_link import scan
from crazyflie_link.address import Address
from crazyflie_link.cflib_internals import packet
from crazyflie_link.crazyflie import MODES, Crazyflie
from crazyflie_link.errors import AddressError, LinkLostError, NoAnswerError, NoDongleError
from crazyflie_link.link import Link, LinkHealth, LinkMonitor, LinkTimeouts

# cflib warns of one of its own attributes when a mock takes stock of them.
pytestmark = pytest.mark.filterwarnings("ignore:link_quality_updated:DeprecationWarning")

URI = "radio://0/25/2M/E7E7E7E701"


class Mock:
    """A link on a cflib that does only what a test has it do."""

    def __init__(self):
        self.cflib = None
        self.fail = None

    def __call__(self, cache, on_error):
        self.cflib = MagicMock(spec=CflibCrazyflie())
        self.cflib.request_source = MagicMock()
        self.cflib.disconnect = MagicMock()
        self.cflib.platform.get_protocol_version.return_value = -1
        self.cflib.is_connected.return_value = False
        self.fail = on_error
        return self.cflib


@pytest.fixture
def mock(monkeypatch):
    mock = Mock()
    monkeypatch.setattr(module, "SafeCrazyflie", mock)
    return mock


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("Couldn't load link driver: Cannot find a Crazyradio Dongle\n\nTraceback", NoDongleError),
        ("Too many packets lost", NoAnswerError),
    ],
)
def test_a_driver_that_gives_up_ends_the_attempt(mock, text, error):
    link = Link(Address.parse(URI))
    mock.cflib.open_link.side_effect = lambda uri: mock.fail(text)
    with pytest.raises(error):
        link.open()
    mock.cflib.open_link.assert_called_once_with(URI)
    mock.cflib.disconnect.assert_called()


def test_a_driver_that_gives_up_as_the_set_up_ends_ends_the_attempt(mock):
    link = Link(Address.parse(URI))

    def open_link(uri):
        mock.fail("Too many packets lost")
        link._on_complete(uri)

    mock.cflib.open_link.side_effect = open_link
    with pytest.raises(NoAnswerError):
        link.open()


def test_a_dongle_that_hangs_does_not_hang_us(mock):
    release = threading.Event()
    link = Link(Address.parse(URI), LinkTimeouts(first_answer=0.3))
    mock.cflib.open_link.side_effect = lambda uri: release.wait(60.0)
    with pytest.raises(NoAnswerError):
        link.open()
    calls = mock.cflib.disconnect.call_count
    assert calls == 1
    # When it comes to life after all, what it opened is closed.
    disconnected = threading.Event()
    mock.cflib.disconnect.side_effect = disconnected.set
    release.set()
    assert disconnected.wait(30.0)


def test_the_first_request_is_repeated(mock):
    link = Link(Address.parse(URI), LinkTimeouts(first_answer=1.0))
    with pytest.raises(NoAnswerError):
        link.open()
    assert mock.cflib.request_source.call_count >= 2


@pytest.mark.parametrize(("protocol", "period", "limit"), [(-1, 0.01, 0.05), (12, 0.2, 5.0)])
def test_the_first_request_is_not_repeated_at_once_or_after_its_answer(
    mock, monkeypatch, protocol, period, limit
):
    times = itertools.count(100.0, period)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: next(times)))
    link = Link(Address.parse(URI), LinkTimeouts(first_answer=limit))
    mock.cflib.platform.get_protocol_version.return_value = protocol
    with pytest.raises(NoAnswerError):
        link.open()
    mock.cflib.request_source.assert_not_called()


def test_a_link_ends_once_with_its_first_error(mock):
    link = Link(Address.parse(URI))
    link.close("first")
    link.close("second")
    assert str(link.error) == "first"
    mock.cflib.disconnect.assert_called_once_with()
    link = Link(Address.parse(URI))
    mock.fail("no driver found")
    link.close("closed")
    assert isinstance(link.error, NoAnswerError)


def test_a_link_is_not_lost_by_a_slow_set_up(mock, monkeypatch):
    now = 0.0
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now))
    link = Link(Address.parse(URI))
    now = 10.0
    link._on_connected(URI)
    assert link.health() == (LinkHealth.ALIVE, "connected")
    assert link.monitor.age(10.0) == 0.0
    link.close()


def test_only_log_data_and_pings_show_that_a_vehicle_lives(mock):
    link = Link(Address.parse(URI))
    (receive,), _ = mock.cflib.packet_received.add_callback.call_args
    (send,), _ = mock.cflib.packet_sent.add_callback.call_args
    packets = [packet(5, 2, b"log"), packet(15, 0, b"ping"), packet(2, 1, b"x"), packet(15, 1, b"")]
    for each in packets:
        receive(each)
        send(each)
    with patch("crazyflie_link.link.LinkMonitor", spec=LinkMonitor) as monitor:
        link._on_connected(URI)
    for each in packets:
        receive(each)
        send(each)
    monitor.return_value.log_received.assert_called_once()
    monitor.return_value.ping_answered.assert_called_once_with(b"ping", ANY)
    monitor.return_value.ping_sent.assert_called_once_with(b"ping")
    link.close()


def test_an_error_in_flight_is_a_lost_link(mock):
    link = Link(Address.parse(URI))
    mock.cflib.is_connected.return_value = True
    link._on_connected(URI)
    link._on_complete(URI)
    assert link.error is None
    # With this cflib's radio driver goes on, and the vehicle may be heard again.
    mock.fail("Too many packets lost")
    assert link.error is None
    mock.fail("it has probably been unplugged!")
    assert isinstance(link.error, LinkLostError)
    assert "the link was lost" in str(link.error)
    link.close()


def test_the_radios_figures():
    with patch("crazyflie_link.crazyflie.Link", spec=Link) as link_class:
        link = link_class.return_value
        link.cflib = CflibCrazyflie()
        link.error = None
        vehicle = Crazyflie(URI)
        vehicle.connect()
        assert vehicle.rssi is None
        link.cflib.link_statistics.uplink_rssi_updated.call(47.0)
        assert vehicle.rssi == 47.0
        vehicle.close()


def test_restarting():
    with patch("crazyflie_link.crazyflie.PowerSwitch", spec=PowerSwitch) as switch:
        Crazyflie(URI).reboot()
        switch.assert_called_once_with(URI)
        switch.return_value.reboot_to_fw.assert_called_once_with()
        switch.return_value.close.assert_called_once_with()


@pytest.mark.parametrize("mode", MODES)
def test_switching_a_vehicle(mode):
    with patch("crazyflie_link.crazyflie.PowerSwitch", spec=PowerSwitch) as switch:
        Crazyflie(URI).reboot(mode)
        getattr(switch.return_value, MODES[mode]).assert_called_once_with()


def test_restarting_a_vehicle_that_is_off():
    with patch("crazyflie_link.crazyflie.PowerSwitch", spec=PowerSwitch) as switch:
        switch.return_value.reboot_to_fw.side_effect = Exception("Failed to connect to Crazyflie")
        with pytest.raises(NoAnswerError, match="Failed to connect"):
            Crazyflie(URI).reboot()
        switch.return_value.close.assert_called_once_with()


def driver_class(base, **behaviour):
    instance = MagicMock(spec=base())
    instance.scan_interface.configure_mock(**behaviour)
    result = MagicMock(return_value=instance)
    result.__name__ = base.__name__
    return result


def test_scanning(monkeypatch):
    def find_no_dongle(address):
        print("Cannot find a Crazyradio Dongle")
        return []

    radio = driver_class(RadioDriver, side_effect=find_no_dongle)
    udp = driver_class(UdpDriver, return_value=[["udp://127.0.0.1:19850", ""]])
    broken = driver_class(UdpDriver, side_effect=OSError())
    monkeypatch.setattr(cflib.crtp, "CLASSES", [radio, udp, broken])
    found, problems = scan("E7E7E7E701")
    assert found == ["udp://127.0.0.1:19850"]
    assert [type(problem) for problem in problems] == [NoDongleError, NoAnswerError]
    radio().scan_interface.assert_called_once_with(0xE7E7E7E701)


@pytest.mark.parametrize("address", ["0", "FFFFFFFFFF"])
def test_the_lowest_and_the_highest_radio_address(monkeypatch, address):
    monkeypatch.setattr(cflib.crtp, "CLASSES", [driver_class(UdpDriver, return_value=[])])
    assert scan(address) == ([], [])


@pytest.mark.parametrize("address", ["", "0x", "10000000000", "hello", "-1", "E7_E7", " E7"])
def test_scanning_for_no_address(address):
    with pytest.raises(AddressError):
        scan(address)
