"""Whatever a client writes and sends, the vehicle goes on: it answers, its body stays finite."""

import logging
import math
import struct

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from virtual_bench import Bench, attitude

from crazyflie_virtual.crtp import Packet, Port
from crazyflie_virtual.firmware_parameters import parameter_specs
from crazyflie_virtual.toc import FLOAT

SPECS = parameter_specs()
NAMES = [f"{spec.group}.{spec.name}" for spec in SPECS]

EDGES = (0.0, -0.0, 1e-30, -1.0, 1e-3, 1.0, 1e9, -1e9, 3.4e38, math.inf, -math.inf, math.nan)
FLOATS = st.one_of(st.sampled_from(EDGES), st.floats(width=32))
SMALL = st.floats(-3.0, 3.0, width=32)
FIELDS = st.one_of(FLOATS, SMALL)
FLAGS = st.integers(0, 1)


def write(index, value):
    return Packet(Port.PARAMETERS, 2, struct.pack("<H", index) + value)


def value_of(index):
    number_type = SPECS[index].number_type
    if number_type is FLOAT:
        return FLOATS.map(number_type.pack)
    return st.binary(min_size=number_type.size, max_size=number_type.size)


def filled(port, channel, form):
    """Return packets of a form as in struct, floats and other fields at random."""
    fields = [
        {"f": FIELDS, "B": st.integers(0, 255), "?": FLAGS, "I": st.integers(0, 2**32 - 1)}.get(
            letter, st.integers(0, 2**15 - 1)
        )
        for letter in form
    ]
    return st.tuples(*fields).map(
        lambda values: Packet(port, channel, struct.pack("<" + form, *values))
    )


def command(port, channel, number, form):
    return filled(port, channel, form).map(
        lambda packet: packet._replace(data=bytes([number]) + packet.data)
    )


WRITES = st.integers(0, len(SPECS) - 1).flatmap(
    lambda index: value_of(index).map(lambda value: write(index, value))
)
SETPOINTS = st.one_of(
    filled(Port.SETPOINT, 0, "fffH"),
    *(
        command(Port.GENERIC_SETPOINT, 0, number, form)
        for number, form in (
            (4, "ffff"),
            (6, "hhhhhhhhhIhhh"),
            (7, "ffff"),
            (8, "ffff"),
            (9, "ffff"),
            (10, "ffff"),
        )
    ),
)
COMMANDS = st.one_of(
    *(
        command(Port.HIGH_LEVEL, 0, number, form)
        for number, form in (
            (3, "B"),
            (7, "Bff?f"),
            (8, "Bff?f"),
            (9, "Bf?f?f"),
            (10, "Bf?f?f"),
            (12, "B??fffff"),
            (13, "B???Bf"),
            (6, "BBBIB"),
        )
    )
)
MEASUREMENTS = st.one_of(
    filled(Port.LOCALIZATION, 0, "fff"), command(Port.LOCALIZATION, 1, 8, "fffffff")
)
RANDOM = st.builds(Packet, st.sampled_from(list(Port)), st.integers(0, 2), st.binary(max_size=30))
STEPS = st.floats(0.0, 0.5).map(lambda duration: ("wait", duration))
ACTIONS = st.lists(
    st.one_of(WRITES, WRITES, SETPOINTS, COMMANDS, MEASUREMENTS, RANDOM, STEPS), max_size=20
)


def is_alive(bench):
    """Return whether an echo comes back; a vehicle that was switched off is switched on first."""
    bench.ask(Port.LINK, 3, b"\xfe\x03")
    return [p.data for p in bench.ask(Port.LINK, 0, b"\x42")] == [b"\x42"]


def play(bench, actions):
    for action in actions:
        if action[0] == "wait":
            bench.run(action[1])
        else:
            bench.ask(*action)
            bench.run(0.01)


@settings(suppress_health_check=list(HealthCheck))
@given(ACTIONS)
def test_any_actions(actions):
    bench = Bench()
    bench.unlock()
    bench.stream(attitude(thrust=45000), 0.3)
    play(bench, actions)
    bench.run(0.1)
    assert all(map(math.isfinite, (*bench.physics.position, *bench.physics.rates)))
    assert all(map(math.isfinite, bench.physics.quaternion))
    if bench.vehicle.board is None:
        # It may be restarting.
        bench.run(1.1)
    if not bench.vehicle._is_dead:
        assert is_alive(bench)


@pytest.fixture
def bench():
    return Bench(positioning="none")


def set_to(bench, name, value):
    bench.ask(*write(NAMES.index(name), FLOAT.pack(value)))


@pytest.mark.parametrize("deviation", [0.0, -0.0, 1e-30])
@pytest.mark.parametrize("name", ["locSrv.extPosStdDev", "locSrv.extQuatStdDev"])
def test_a_measurement_without_deviation_counts_in_full(bench, name, deviation, caplog):
    set_to(bench, name, deviation)
    pose = struct.pack("<B7f", 8, 0.3, 0.2, 0.1, 0.0, 0.0, 0.6, 0.8)
    for _ in range(3):
        for _ in range(3):
            bench.ask(Port.LOCALIZATION, 1, pose)
        bench.run(0.02)
    assert caplog.records == []
    estimate = bench.firmware.estimate
    assert estimate.x == pytest.approx(0.3, abs=0.01)
    assert estimate.qz == pytest.approx(0.6, abs=0.01)


@pytest.mark.parametrize("speed", [0.0, -0.0, 1e-30])
def test_a_climb_without_speed_is_slow(speed, caplog):
    bench = Bench()
    set_to(bench, "hlCommander.vtoff", speed)
    take_off = struct.pack("<BBf?f?f", 9, 0, 0.5, False, 0.0, False, 0.0)
    assert bench.ask_one(Port.HIGH_LEVEL, 0, take_off)[3] == 0
    bench.run(1.0)
    assert caplog.records == []
    assert bench.height < 0.1


def test_gains_that_are_no_numbers_stop_the_motors(bench):
    bench.unlock()
    bench.stream(attitude(thrust=45000), 0.5)
    set_to(bench, "pid_rate.roll_kp", math.nan)
    bench.stream(attitude(thrust=45000), 0.5)
    assert all(map(math.isfinite, (*bench.physics.position, *bench.physics.rates)))
    assert bench.height < 0.3


def test_an_estimate_that_is_no_number_is_reset(bench):
    bench.ask(Port.LINK, 0, b"")
    bench.firmware.estimate.vx = math.nan
    bench.run(0.05)
    assert bench.firmware.estimate.is_finite
    assert "ESTKALMAN" in console(bench)


def console(bench):
    return b"".join(p.data for p in bench.unsolicited if p.port == Port.CONSOLE).decode()


def raise_error(*_):
    raise RuntimeError("a fault of ours")


def test_an_error_in_a_packet_is_told_and_the_vehicle_goes_on(bench, monkeypatch, caplog):
    bench.ask(Port.LINK, 0, b"")
    with monkeypatch.context() as patch:
        patch.setattr(bench.vehicle.board, "receive", raise_error)
        for _ in range(5):
            assert bench.ask(Port.LINK, 0, b"\x42") == []
    assert is_alive(bench)
    bench.run(0.02)
    assert console(bench).count("SYS: RuntimeError in packet fc42: a fault of ours") == 1
    assert [record.levelno for record in caplog.records] == [logging.ERROR]
    assert caplog.records[0].exc_info
    caplog.clear()


@pytest.mark.parametrize(
    ("command", "is_on"),
    [
        (b"\xfe", True),
        (b"\xfe\xff", True),
        (b"\xfe\xf0", True),
        (b"\xfe\xf0\x00", True),
        (b"\xfe\x02", False),
        (b"\xfe\x01", False),
    ],
)
def test_a_restart_ends_when_the_vehicle_is_switched_off(
    bench, monkeypatch, caplog, command, is_on
):
    monkeypatch.setattr(bench.firmware, "step", raise_error)
    bench.run(0.5)
    bench.ask(Port.LINK, 3, command)
    assert bench.vehicle.board is None
    bench.run(2.0)
    assert (bench.vehicle.board is not None) == is_on
    caplog.clear()


@pytest.mark.parametrize("command", [b"\xfe\x03", b"\xfe\xf0\x01"])
def test_a_restart_is_over_when_the_vehicle_is_switched_on(bench, monkeypatch, caplog, command):
    monkeypatch.setattr(bench.firmware, "step", raise_error)
    bench.run(0.5)
    bench.ask(Port.LINK, 3, command)
    begun = bench.firmware
    bench.run(2.0)
    assert bench.firmware is begun
    caplog.clear()


def test_after_an_error_in_a_step_the_vehicle_restarts(bench, monkeypatch, caplog):
    bench.unlock()
    bench.stream(attitude(thrust=50000), 1.0)
    assert bench.height > 0.2
    monkeypatch.setattr(bench.firmware, "step", raise_error)
    bench.run(0.9)
    # Without its microcontroller it falls.
    assert bench.vehicle.board is None
    bench.run(2.0)
    assert bench.height == 0.0
    assert is_alive(bench)
    bench.run(0.02)
    assert "SYS: RuntimeError in a step: a fault of ours" in console(bench)
    assert len(caplog.records) == 1
    caplog.clear()
