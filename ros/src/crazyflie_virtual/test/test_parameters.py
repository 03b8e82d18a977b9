"""The table of parameters, and what survives a restart; more in test_recorded_wire.py."""

import errno
import math
import struct

import pytest
from virtual_bench import Bench

from crazyflie_virtual.crtp import Port
from crazyflie_virtual.firmware_parameters import parameter_specs
from crazyflie_virtual.toc import FLOAT

TABLE, READ, WRITE, MISC = 0, 1, 2, 3
READ_ONLY, EXTENDED = 0x40, 0x10

SET_BY_USERS = """
stabilizer.estimator stabilizer.controller stabilizer.stop commander.enHighLevel hlCommander.vtoff
hlCommander.vland kalman.resetEstimation kalman.initialX kalman.initialYaw locSrv.extPosStdDev
locSrv.extQuatStdDev pid_attitude.roll_kp pid_attitude.yawMaxDelta pid_rate.pitch_kd
posCtlPid.xKp posCtlPid.thrustBase posCtlPid.rLimit velCtlPid.vzKi velCtlPid.vxKFF
powerDist.idleThrust motorPowerSet.enable ring.effect ring.solidRed ring.headlightEnable
flightmode.stabModeRoll flightmode.poshold pm.lowVoltage health.startPropTest sound.effect
supervisor.tmblChckEn system.selftestPassed firmware.revision0 deck.bcFlow2 deck.bcLighthouse4
cpu.flash imu_sensors.BMP388 led.bitmask memTst.resetW
""".split()

NAMES = [f"{spec.group}.{spec.name}" for spec in parameter_specs()]


@pytest.fixture
def bench():
    return Bench()


def number(name):
    return struct.pack("<H", NAMES.index(name))


def read(bench, name):
    """Return the value of a parameter."""
    spec = parameter_specs()[NAMES.index(name)]
    answer = bench.ask_one(Port.PARAMETERS, READ, number(name))
    assert answer[:3] == number(name) + b"\0"
    return spec.number_type.unpack(answer[3:])


def write(bench, name, value):
    """Set a parameter; return the value in the answer."""
    spec = parameter_specs()[NAMES.index(name)]
    data = number(name) + spec.number_type.pack(value)
    answer = bench.ask_one(Port.PARAMETERS, WRITE, data)
    assert answer[:2] == number(name)
    return spec.number_type.unpack(answer[2:])


def misc(bench, command, name):
    answer = bench.ask_one(Port.PARAMETERS, MISC, bytes([command]) + number(name))
    assert answer[:3] == bytes([command]) + number(name)
    return answer[3:]


@pytest.mark.parametrize("name", SET_BY_USERS)
def test_users_parameters_exist(name):
    assert name in NAMES


def test_table(bench):
    info = bench.ask_one(Port.PARAMETERS, TABLE, b"\x03")
    assert len(info) == 7
    assert struct.unpack_from("<H", info, 1) == (len(NAMES),)
    log_info = bench.ask_one(Port.LOG, TABLE, b"\x03")
    assert info[3:7] != log_info[3:7]
    item = bench.ask_one(Port.PARAMETERS, TABLE, b"\x02" + number("posCtlPid.thrustBase"))
    assert item[3] == 0x9 | EXTENDED | 0x20
    assert item[4:] == b"posCtlPid\0thrustBase\0"
    item = bench.ask_one(Port.PARAMETERS, TABLE, b"\x02" + number("deck.bcFlow2"))
    assert item[3] == 0x8 | READ_ONLY


def test_the_default_speeds_of_the_high_level_commander_cannot_be_stored(bench):
    for name in ("hlCommander.vtoff", "hlCommander.vland"):
        item = bench.ask_one(Port.PARAMETERS, TABLE, b"\x02" + number(name))
        assert not item[3] & EXTENDED


def test_every_parameter_can_be_read_and_fits_into_a_packet(bench):
    assert len(set(NAMES)) == len(NAMES)
    for spec, name in zip(parameter_specs(), NAMES, strict=True):
        assert math.isfinite(read(bench, name))
        assert len(spec.group) + len(spec.name) <= 24


@pytest.mark.parametrize(
    ("channel", "data"), [(READ, b""), (WRITE, b""), (MISC, b""), (MISC, b"\0ring\0effect\0")]
)
def test_what_asks_nothing_is_not_answered(bench, channel, data):
    assert bench.ask(Port.PARAMETERS, channel, data) == []


def test_stored_parameters_outlive_a_restart(bench):
    write(bench, "posCtlPid.xKp", 1.5)
    assert misc(bench, 4, "posCtlPid.xKp") == b"\0" + FLOAT.pack(2.0)
    assert misc(bench, 3, "posCtlPid.xKp") == b"\0"
    assert misc(bench, 4, "posCtlPid.xKp") == b"\1" + FLOAT.pack(2.0) + FLOAT.pack(1.5)
    write(bench, "posCtlPid.yKp", 1.5)
    for command in (2, 3):
        bench.ask(Port.LINK, 3, bytes([0xFE, command]))
    assert read(bench, "posCtlPid.xKp") == 1.5
    assert read(bench, "posCtlPid.yKp") == 2.0
    assert misc(bench, 5, "posCtlPid.xKp") == b"\0"
    assert misc(bench, 4, "posCtlPid.xKp") == b"\0" + FLOAT.pack(2.0)
    assert misc(bench, 3, "stabilizer.stop") == bytes([errno.ENOENT])


def test_fault_switches_are_parameters(bench):
    write(bench, "virtual.motorFailure", 3)
    write(bench, "virtual.loss", 0.25)
    assert write(bench, "virtual.loss", 1.5) == 0.25
    assert write(bench, "virtual.delay", math.nan) == 0.0
    assert bench.vehicle.faults.motor_failure == 3
    assert bench.vehicle.faults.loss == 0.25
