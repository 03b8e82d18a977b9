"""The small ports, and packets of any content at all of them."""

import errno
import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from virtual_bench import Bench, attitude

from crazyflie_model.supervisor import SupervisorState
from crazyflie_virtual.crtp import Packet, Port
from crazyflie_virtual.firmware_parameters import parameter_specs
from crazyflie_virtual.settings import VehicleSettings
from crazyflie_virtual.vehicle import VirtualVehicle


@pytest.fixture
def bench():
    return Bench()


def test_scan_is_answered(bench):
    assert [p[:2] for p in bench.ask(Port.LINK, 3, b"")] == [(15, 3)]


def test_rubbish_is_not_answered(bench):
    assert bench.vehicle.receive(b"") == []
    assert bench.vehicle.receive(bytes(40)) == []
    assert bench.ask(1, 0, b"\1\2\3") == []


def test_versions(bench):
    assert bench.ask_one(Port.PLATFORM, 1, b"\0") == b"\0" + struct.pack("<i", 12)
    assert Bench(protocol=11).ask_one(Port.PLATFORM, 1, b"\0") == b"\0" + struct.pack("<i", 11)


def test_protocol_11_has_no_supervisor_port():
    bench = Bench(protocol=11, auto_arm=False)
    assert bench.ask(Port.SUPERVISOR, 0, b"\x0c") == []
    assert bench.ask(Port.SUPERVISOR, 1, b"\1\1") == []
    assert not bench.firmware.supervisor.is_armed
    assert bench.ask_one(Port.PLATFORM, 0, b"\1\1") == b"\1\1\1"


@pytest.mark.parametrize("protocol", [11, 12])
def test_the_high_level_commander_is_reported_from_protocol_12_on(protocol):
    bench = Bench(protocol=protocol)
    bench.ask_one(Port.HIGH_LEVEL, 0, struct.pack("<BBff?f", 7, 0, 0.5, 0.0, True, 1.0))
    bench.run(0.5)
    assert SupervisorState.CAN_FLY in bench.firmware.info
    assert bench.firmware.info.reports_planner is (protocol == 12)
    assert bench.ask_one(Port.PLATFORM, 1, b"\2") == b"\2Crazyflie 2.1"
    assert bench.ask(Port.PLATFORM, 1, b"\x63") == []


def test_console_waits_for_a_client(bench):
    assert bench.unsolicited == []
    bench.ask(Port.LINK, 0, b"")
    bench.run(0.01)
    texts = [p for p in bench.unsolicited if p.port == Port.CONSOLE]
    assert all(len(p.data) <= 30 for p in texts)
    text = b"".join(p.data for p in texts).decode()
    assert "Virtual Crazyflie 2.1 is up and running!\n" in text


# Memories.


def memories(bench):
    """Return type, size and serial number of all memories."""
    count = bench.ask_one(Port.MEMORY, 0, b"\1")[1]
    details = [bench.ask_one(Port.MEMORY, 0, bytes([2, i])) for i in range(count)]
    assert [d[:2] for d in details] == [bytes([2, i]) for i in range(count)]
    assert bench.ask_one(Port.MEMORY, 0, bytes([2, count])) == bytes([2, count])
    return [struct.unpack("<BI8s", d[2:]) for d in details]


def test_list_of_memories(bench):
    no_serial = bytes(8)
    assert memories(bench) == [
        (0x00, 8191, bytes(7) + b"\x50"),
        (0x12, 4096, no_serial),
        (0x15, 4096, no_serial),
        (0x10, 24, no_serial),
        (0x17, 40, no_serial),
        (0x14, 0x1000 + 4 * 61, no_serial),
        (0x19, 0x50000000, no_serial),
        *((0x01, 112, bytes([0x0D, product]) + bytes(6)) for product in (0x01, 0x0F, 0x10)),
    ]


@pytest.mark.parametrize(
    ("options", "names"),
    [
        ({"positioning": "none"}, {"bcLedRing"}),
        ({}, {"bcLedRing", "bcFlow2", "bcLighthouse4", "bcZRanger2"}),
        ({"positioning": "none", "multiranger": True}, {"bcLedRing", "bcMultiranger"}),
        ({"positioning": "none", "color_leds": True}, {"bcColorLedBot", "bcColorLedTop"}),
    ],
)
def test_decks_have_parameters_and_one_wire_memories(options, names):
    bench = Bench(**options)
    decks = [(i, s) for i, s in enumerate(parameter_specs()) if s.group == "deck"]
    attached = {
        spec.name for i, spec in decks if bench.ask_one(Port.PARAMETERS, 1, struct.pack("<H", i))[3]
    }
    assert attached == names
    one_wire = [m for m in memories(bench) if m[0] == 0x01]
    # The ranging sensor down is on the flow deck.
    assert len(one_wire) == len(names - {"bcZRanger2"})


def test_lighthouse_data_outlive_a_restart_when_stored(bench):
    data = struct.pack("<BI", 5, 0x1100) + bytes(range(24))
    read = struct.pack("<BIB", 5, 0x1100, 24)

    def restart():
        for command in (2, 3):
            bench.ask(Port.LINK, 3, bytes([0xFE, command]))

    assert bench.ask_one(Port.MEMORY, 2, data)[-1] == 0
    restart()
    assert bench.ask_one(Port.MEMORY, 1, read)[6:] == bytes(24)
    bench.ask_one(Port.MEMORY, 2, data)
    store = struct.pack("<BHH", 11, 0, 0b10)
    assert bench.ask_one(Port.LOCALIZATION, 1, store) == b"\x0b\1"
    restart()
    assert bench.ask_one(Port.MEMORY, 1, read)[6:] == bytes(range(24))
    # There are four base stations.
    assert bench.ask_one(Port.LOCALIZATION, 1, struct.pack("<BHH", 11, 0x10, 0)) == b"\x0b\0"
    assert bench.ask_one(Port.MEMORY, 1, struct.pack("<BIB", 5, 0x400, 1))[-1] == errno.EIO


def test_a_memory_that_does_not_exist(bench):
    beginning, error = struct.pack("<BI", 99, 0), bytes([errno.EIO])
    assert bench.ask_one(Port.MEMORY, 1, beginning + b"\1") == beginning + error
    assert bench.ask_one(Port.MEMORY, 2, beginning + b"\0") == beginning + error


def test_eeprom_has_the_radio_address():
    bench = Bench(address=0x2A)
    content = bench.ask_one(Port.MEMORY, 1, struct.pack("<BIB", 0, 0, 21))[6:]
    assert content[:5] == b"0xBC\x01"
    high, low = struct.unpack_from("<BI", content, 15)
    assert (high << 32 | low) == 0xE7E7E7E72A
    assert content[20] == sum(content[:20]) % 256


def test_memory_tester(bench):
    assert bench.ask_one(Port.MEMORY, 1, struct.pack("<BIB", 2, 250, 10))[6:] == bytes(
        (250 + i) % 256 for i in range(10)
    )
    bench.ask(Port.MEMORY, 2, struct.pack("<BI", 2, 10) + bytes([10, 11, 99, 13]))
    assert bench.firmware.memory_tester.errors == 1
    bench.firmware.memory_tester.reset_writes = 1
    assert bench.firmware.memory_tester.errors == 0


# Supervisor.


def test_it_can_fly_from_the_first_moment():
    assert VirtualVehicle(VehicleSettings()).board.firmware.supervisor.can_fly


def test_supervisor_bits(bench):
    # Armed, arms itself, can fly; nothing planned is finished.
    assert bench.ask_one(Port.SUPERVISOR, 0, b"\x0c") == b"\x8c" + struct.pack("<H", 0x20E)
    assert bench.ask_one(Port.SUPERVISOR, 0, b"\x02") == b"\x82\x01"
    bench.take_off()
    (bits,) = struct.unpack("<H", bench.ask_one(Port.SUPERVISOR, 0, b"\x0c")[1:])
    assert bits == 0x31E


def test_arming_by_the_client():
    bench = Bench(auto_arm=False)
    assert bench.ask_one(Port.SUPERVISOR, 0, b"\x0c") == b"\x8c" + struct.pack("<H", 0x201)
    assert bench.ask_one(Port.SUPERVISOR, 1, b"\x01\x01") == b"\x81\x01\x01"
    bench.run(0.1)
    # Twice is as good as once.
    assert bench.ask_one(Port.SUPERVISOR, 1, b"\x01\x01") == b"\x81\x01\x01"
    bench.take_off()
    assert bench.ask_one(Port.SUPERVISOR, 1, b"\x01\x00") == b"\x81\x01\x00"
    bench.run(1.0)
    assert bench.height == 0.0


def test_arming_as_older_clients_do_it():
    bench = Bench(auto_arm=False)
    assert bench.ask_one(Port.PLATFORM, 0, b"\x01\x01") == b"\x01\x01\x01"
    assert bench.ask_one(Port.PLATFORM, 0, b"\x02") == b"\x02\x01\x01"


def test_vehicle_that_is_not_armed_does_not_fly():
    bench = Bench(auto_arm=False)
    take_off = struct.pack("<BBff?f", 7, 0, 1.0, 0.0, False, 2.0)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, take_off)[3] != 0
    bench.run(1.0)
    assert not bench.motors_run


# Localization.


def test_packed_positions_and_poses_are_for_those_with_the_address(bench):
    def x():
        return round(bench.firmware.localization.x, 3)

    bench.ask(Port.LOCALIZATION, 2, struct.pack("<B3hB3h", 1, 100, 0, 0, 0xE7, 250, 0, 0))
    assert x() == 0.25
    pose = struct.pack("<BB3hI", 9, 0xE7, 500, 0, 0, 3 << 30)
    bench.ask(Port.LOCALIZATION, 1, pose)
    assert x() == 0.5
    assert bench.firmware.localization.qw == 1.0
    bench.ask(Port.LOCALIZATION, 1, struct.pack("<BB3hI", 9, 0x01, 900, 0, 0, 3 << 30))
    assert x() == 0.5


@pytest.mark.parametrize(
    ("channel", "data"),
    [
        (0, struct.pack("<fff", np.nan, 0, 0)),
        (0, b"\0\0"),
        (1, struct.pack("<B7f", 8, 0, 0, 0, 0, 0, 0, 0)),
        (1, struct.pack("<B7f", 8, 0, 0, np.inf, 0, 0, 0, 1)),
        (1, b"\x08"),
        (1, b""),
    ],
)
def test_invalid_measurements_are_ignored(bench, channel, data):
    assert bench.ask(Port.LOCALIZATION, channel, data) == []
    assert bench.firmware.localization.time is None


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
