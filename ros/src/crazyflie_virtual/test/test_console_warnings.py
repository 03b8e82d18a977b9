"""Commands of a client without effect are reported on the console, at most once a second."""

import struct

import pytest
from virtual_bench import Bench

from crazyflie_virtual.crtp import Port
from crazyflie_virtual.firmware_parameters import parameter_specs

NAMES = [f"{spec.group}.{spec.name}" for spec in parameter_specs()]


def write(name, value):
    return (Port.PARAMETERS, 2, struct.pack("<H", NAMES.index(name)) + value)


@pytest.fixture
def bench():
    bench = Bench()
    bench.ask(Port.LINK, 0, b"")
    bench.run(0.01)
    return bench


def lines(bench):
    """Return what was printed since."""
    bench.run(0.01)
    pieces = [p.data for p in bench.unsolicited if p.port == Port.CONSOLE]
    bench.unsolicited.clear()
    return b"".join(pieces).decode().splitlines()


@pytest.mark.parametrize(
    ("packet", "text"),
    [
        ((1, 0, b"\1"), "port 1"),
        (write("deck.bcFlow2", b"\0"), "deck.bcFlow2 is read-only"),
        (write("virtual.loss", struct.pack("<f", 2.0)), "virtual.loss is 0 to 1"),
        ((Port.PARAMETERS, 2, b"\xff\xff\0"), "no parameter has the number ffff"),
        ((Port.PARAMETERS, 3, b"\x63\0\0"), "unknown command 63"),
        ((Port.LOG, 1, b"\x63\0"), "unknown command 99"),
        ((Port.MEMORY, 0, b"\x63"), "unknown request 63"),
        ((Port.MEMORY, 3, b"\x01"), "unknown request 01"),
        ((Port.MEMORY, 2, struct.pack("<BI", 1, 4096) + b"\0"), "no 1 bytes at 0x1000 to write"),
        ((Port.PLATFORM, 0, b"\x63"), "unknown command 0/99"),
        ((Port.PLATFORM, 1, b"\x63"), "unknown version 99"),
        ((Port.LOCALIZATION, 1, b"\x63"), "message 99"),
        ((Port.LOCALIZATION, 3, b""), "0 bytes on channel 3"),
        ((Port.LOCALIZATION, 0, b"\0" * 8), "8 bytes on channel 0"),
        ((Port.LOCALIZATION, 0, b"\xff" * 12), "not a number"),
        ((Port.LOCALIZATION, 1, b"\x08" + bytes(28)), "not a rotation"),
        ((Port.SUPERVISOR, 1, b"\x63"), "SUP: unknown command 1/99"),
        ((Port.SUPERVISOR, 0, b"\x0d"), "SUP: unknown command 0/13"),
        ((Port.SUPERVISOR, 2, b"\x01"), "SUP: unknown command 2/1"),
        ((Port.HIGH_LEVEL, 0, b"\x63"), "HLC: unknown command 99"),
        ((Port.HIGH_LEVEL, 0, b"\x07\x00"), "HLC: command 7 is too short"),
        ((Port.SETPOINT, 1, bytes(14)), "CMD: unknown channel 1"),
        ((Port.GENERIC_SETPOINT, 1, b"\x63"), "CMD: unknown command 1/63"),
        ((Port.GENERIC_SETPOINT, 0, b"\x63"), "CMD: unknown type of setpoint 63"),
    ],
)
def test_in_vain(bench, packet, text):
    lines(bench)
    for _ in range(10):
        bench.ask(*packet)
    (line,) = lines(bench)
    assert text in line
    bench.ask(*packet)
    assert lines(bench) == []
    bench.run(1.0)
    bench.ask(*packet)
    assert len(lines(bench)) == 1


def test_parameter_without_effect(bench):
    lines(bench)
    for value in (b"\xff", b"\0", b"\xff"):
        bench.ask(*write("led.bitmask", value))
    (line,) = lines(bench)
    assert "led.bitmask is stored" in line


def test_what_has_an_effect_prints_no_warning(bench):
    lines(bench)
    bench.ask(*write("posCtlPid.xKp", struct.pack("<f", 1.5)))
    # It is 2 already.
    bench.ask(*write("stabilizer.estimator", b"\2"))
    assert lines(bench) == []
