"""No packet, however strange, stops the vehicle."""

import math
import struct

from hypothesis import given
from hypothesis import strategies as st
from virtual_bench import Bench, attitude

from crazyflie_virtual.crtp import Packet, Port

FLOATS = st.floats(width=32)
PORTS = st.sampled_from(list(Port))

BYTES = st.builds(
    lambda port, channel, data: Packet(port, channel, data).encode(),
    PORTS,
    st.integers(0, 3),
    st.binary(max_size=30),
)
NUMBERS = st.builds(
    lambda port, channel, head, numbers: Packet(
        port, channel, (bytes(head) + struct.pack(f"<{len(numbers)}f", *numbers))[:30]
    ).encode(),
    PORTS,
    st.integers(0, 3),
    st.lists(st.integers(0, 16), max_size=4),
    st.lists(FLOATS, max_size=7),
)


def assert_is_somewhere(bench):
    assert not any(map(math.isnan, (*bench.physics.position, *bench.physics.rates)))


@given(st.lists(st.one_of(BYTES, NUMBERS), max_size=12))
def test_any_packets(datagrams):
    bench = Bench()
    bench.unlock()
    bench.ask(*attitude(thrust=30000))
    for datagram in datagrams:
        for answer in bench.vehicle.receive(datagram):
            assert 1 <= len(answer) <= 31
        bench.run(0.02)
    assert_is_somewhere(bench)


@given(st.binary(max_size=60))
def test_any_datagram(datagram):
    bench = Bench()
    assert all(1 <= len(answer) <= 31 for answer in bench.vehicle.receive(datagram))
    bench.run(0.02)
    assert_is_somewhere(bench)
