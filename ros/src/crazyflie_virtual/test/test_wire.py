"""Packets, types and tables as bytes."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_virtual.crtp import Packet, decode
from crazyflie_virtual.toc import (
    FLOAT,
    FP16,
    I8,
    I16,
    LOG_TYPES,
    PARAMETER_TYPES,
    U8,
    U16,
    U32,
    Table,
)


def test_header_is_port_reserved_bits_channel():
    assert Packet(5, 2, b"\x01").encode() == b"\x5e\x01"
    assert Packet(15, 3, b"").encode() == b"\xff"


@given(st.integers(0, 15), st.integers(0, 3), st.binary(max_size=30))
def test_packets_come_back(port, channel, data):
    assert decode(Packet(port, channel, data).encode()) == (port, channel, data)


def test_packets_of_a_wrong_size_are_refused():
    assert decode(b"") is None
    assert decode(bytes(32)) is None
    with pytest.raises(ValueError, match="30 bytes, got 31"):
        Packet(0, 0, bytes(31)).encode()


def test_codes_of_the_types():
    assert [LOG_TYPES[i].name for i in range(1, 9)] == [
        "uint8_t",
        "uint16_t",
        "uint32_t",
        "int8_t",
        "int16_t",
        "int32_t",
        "float",
        "FP16",
    ]
    sizes = {code: number_type.size for code, number_type in PARAMETER_TYPES.items()}
    assert sizes == {0x8: 1, 0x9: 2, 0xA: 4, 0xB: 8, 0x0: 1, 0x1: 2, 0x2: 4, 0x6: 4}


@pytest.mark.parametrize(
    ("number_type", "value", "packed"),
    [
        (U8, True, b"\x01"),
        (U8, 300.0, b"\xff"),
        (U16, -1, b"\x00\x00"),
        (I8, -200.0, b"\x80"),
        (I16, 1234.9, b"\xd2\x04"),
        (U32, math.nan, bytes(4)),
        (FLOAT, 1.5, struct.pack("<f", 1.5)),
        (FLOAT, 1e300, struct.pack("<f", 3.4028234e38)),
        (FP16, 1e6, struct.pack("<e", 65504.0)),
    ],
)
def test_values_are_limited_to_their_type(number_type, value, packed):
    assert number_type.pack(value) == packed


def entries(*names):
    return [("group", name, 7) for name in names]


def test_table_answers():
    table = Table(entries("a", "b"), limits=b"\x10\x80")
    info = table.answer(b"\x03")
    assert info == b"\x03\x02\x00" + struct.pack("<I", table.crc) + b"\x10\x80"
    assert table.answer(b"\x02\x01\x00") == b"\x02\x01\x00\x07group\x00b\x00"
    assert table.answer(b"\x02\x02\x00") == b"\x02"
    assert table.answer(b"\x00") is None


def test_checksum_changes_with_the_table():
    tables = [Table(entries("a", "b")), Table(entries("b", "a")), Table(entries("a"))]
    assert len({table.crc for table in tables}) == 3
