"""Effects of a vehicle's packets, on a mock of its link."""

from unittest.mock import MagicMock, patch

import pytest
from cflib.crazyflie import Crazyflie as CflibCrazyflie

from crazyflie_link.cflib_internals import packet, table_cache
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.link import Link, LinkHealth, LinkMonitor

URI = "radio://0/25/2M/E7E7E7E701"
LOG = 5, 2


class Bench:
    """A connected vehicle, the arguments of its link, and what it has handed on."""

    def __init__(self, link_class, **options):
        self.lines = []
        self.link = link_class.return_value
        self.link.cflib, self.link.error = CflibCrazyflie(), None
        self.link.monitor = MagicMock(spec=LinkMonitor)
        self.link.health.return_value = LinkHealth.ALIVE, ""
        self.vehicle = Crazyflie(URI, on_console=self.lines.append, **options)
        self.vehicle.connect()
        _, _, self.cache, self.receive = link_class.call_args.args


@pytest.fixture
def make_bench():
    benches = []

    def make(**options):
        benches.append(Bench(link_class, **options))
        return benches[-1]

    with patch("crazyflie_link.crazyflie.Link", spec=Link) as link_class:
        yield make
        for bench in benches:
            bench.vehicle.close()


@pytest.mark.parametrize("cache", [None, "/here"])
def test_tables_are_in_the_folder_that_is_given_or_in_the_user_s(make_bench, cache):
    assert make_bench(cache=cache).cache == (cache or table_cache())


def test_the_console_is_channel_0_of_port_0(make_bench):
    bench = make_bench()
    for port, channel, text in ((0, 1, b"a\n"), (1, 0, b"b\n"), (0, 0, b"c\n")):
        bench.receive(port, channel, text)
    assert bench.lines == ["c"]


def test_packets_to_all_vehicles_are_not_counted(make_bench):
    bench = make_bench()
    sent = packet(7, 0, b"\0")
    for _ in range(2):
        bench.link.cflib.packet_sent.call(sent)
    assert bench.vehicle.sent == 2
    sent.header &= 0xF3
    bench.link.cflib.packet_sent.call(sent)
    assert bench.vehicle.sent == 2


@pytest.mark.parametrize(
    ("place", "data", "restarts"),
    [
        (LOG, b"\1\xff\xff\0x", 1),
        (LOG, b"\1\xff\xff\0", 0),
        (LOG, b"\1\xff\xff", 0),
        ((5, 1), b"\1\xff\xff\0x", 0),
    ],
)
def test_only_log_data_show_a_restart(make_bench, place, data, restarts):
    bench = make_bench()
    assert bench.vehicle.restarts == 0
    bench.receive(*LOG, b"\1\0\0\0x")
    bench.receive(*place, data)
    assert bench.vehicle.restarts == restarts


@pytest.mark.parametrize("is_poor", [True, False])
def test_the_figures_of_a_link(make_bench, is_poor):
    bench = make_bench()
    bench.link.monitor.is_poor.return_value = is_poor
    assert bench.vehicle.is_poor() == is_poor
    bench.link.cflib.link_statistics.latency.latency = 250.0
    assert bench.vehicle.latency() == 0.25
