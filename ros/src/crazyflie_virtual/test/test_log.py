"""Log blocks, byte by byte, and the table of variables; errors are in test_recorded_wire.py."""

import errno
import struct

import pytest
from virtual_bench import Bench

from crazyflie_virtual.crtp import Port
from crazyflie_virtual.log import log_variables, packed
from crazyflie_virtual.toc import FLOAT, I16, LOG_TYPES, U16

TABLE, CONTROL, DATA = 0, 1, 2

LOGGED_BY_USERS = """
stateEstimate.x stateEstimate.vz stateEstimate.ax stateEstimate.roll stateEstimate.qw
stateEstimateZ.x stateEstimateZ.quat stateEstimateZ.rateYaw stabilizer.roll stabilizer.thrust
acc.x acc.z gyro.x gyro.z mag.x mag.z baro.asl baro.temp baro.pressure pm.vbat pm.state
pm.batteryLevel radio.rssi ctrltarget.x ctrltarget.yaw ctrltargetZ.vx motor.m1 motor.m4
supervisor.info sys.canfly sys.isFlying health.motorPass kalman.varPX kalman.stateX kalman.q0
locSrv.x locSrv.qw locSrvZ.tick ext_pos.X controller.cmd_thrust controller.yawRate
pid_attitude.roll_outP pid_rate.yaw_outI posCtl.targetX posCtl.VZi ring.fadeTime memTst.errCntW
""".split()


@pytest.fixture
def bench():
    return Bench()


def control(bench, *data):
    return bench.ask_one(Port.LOG, CONTROL, bytes(data))


def index(bench, name):
    """Return number and code of a variable as a client reads them from the table."""
    (count,) = struct.unpack_from("<H", bench.ask_one(Port.LOG, TABLE, b"\x03"), 1)
    for number in range(count):
        item = bench.ask_one(Port.LOG, TABLE, b"\x02" + struct.pack("<H", number))
        group, variable, _ = item[4:].split(b"\0")
        if f"{group.decode()}.{variable.decode()}" == name:
            return struct.pack("<BH", item[3], number)
    raise AssertionError(f"no variable {name}")


def data_packets(bench):
    return [p.data for p in bench.unsolicited if (p.port, p.channel) == (Port.LOG, DATA)]


def test_table_tells_its_limits(bench):
    info = bench.ask_one(Port.LOG, TABLE, b"\x03")
    assert len(info) == 9
    assert info[-2:] == b"\x10\x80"
    assert bench.ask(Port.LOG, CONTROL, b"") == []


@pytest.mark.parametrize("name", LOGGED_BY_USERS)
def test_users_variables_exist(name):
    assert name in {f"{v.group}.{v.name}" for v in log_variables()}


def test_every_variable_can_be_read_and_fits_into_a_packet(bench):
    for variable in log_variables():
        assert (
            len(variable.number_type.pack(variable.read(bench.firmware)))
            == variable.number_type.size
        )
        assert len(variable.group) + len(variable.name) <= 24
    names = [(v.group, v.name) for v in log_variables()]
    assert len(set(names)) == len(names)


def test_block_sends_its_values_in_its_period(bench):
    bench.firmware.estimate.x = 0.0
    assert control(bench, 5, 0) == b"\x05\x00\x00"
    variables = index(bench, "stateEstimate.z") + index(bench, "stabilizer.yaw")
    assert control(bench, 6, 7, *variables) == b"\x06\x07\x00"
    assert control(bench, 7, 7, *index(bench, "pm.vbatMV")) == b"\x07\x07\x00"
    begin = bench.firmware.milliseconds
    assert control(bench, 3, 7, 2) == b"\x03\x07\x00"
    bench.run(0.2)
    packets = data_packets(bench)
    assert len(packets) == 10
    assert [p[0] for p in packets] == [7] * 10
    stamps = [int.from_bytes(p[1:4], "little") for p in packets]
    assert stamps == [begin + 20 * k for k in range(1, 11)]
    z, yaw, millivolts = struct.unpack("<ffH", packets[-1][4:])
    assert z == pytest.approx(bench.firmware.estimate.z, abs=1e-6)
    assert yaw == pytest.approx(bench.firmware.estimate.yaw, abs=1e-6)
    assert millivolts == int(1000.0 * bench.vehicle.board.firmware.power.voltage)


def test_stopped_and_deleted_blocks_are_silent(bench):
    control(bench, 6, 1, *index(bench, "acc.x"))
    control(bench, 6, 2, *index(bench, "acc.y"))
    control(bench, 3, 1, 1)
    control(bench, 3, 2, 1)
    bench.run(0.05)
    assert {p[0] for p in data_packets(bench)} == {1, 2}
    assert control(bench, 4, 1) == b"\x04\x01\x00"
    assert control(bench, 2, 2) == b"\x02\x02\x00"
    bench.unsolicited.clear()
    bench.run(0.05)
    assert data_packets(bench) == []
    assert control(bench, 3, 1, 1)[2] == 0
    assert control(bench, 3, 2, 1)[2] == errno.ENOENT
    bench.run(0.05)
    assert {p[0] for p in data_packets(bench)} == {1}


def test_values_are_converted_to_the_type_that_is_asked_for(bench):
    _, *number = index(bench, "acc.z")
    control(bench, 6, 1, 0x08, *number)
    control(bench, 3, 1, 1)
    bench.run(0.01)
    (value,) = struct.unpack("<e", data_packets(bench)[-1][4:])
    assert value == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("stored", "value", "code", "sent"),
    [
        # As the firmware: the low bytes of a whole number of 32 bits.
        (U16, 526, 1, b"\x0e"),
        (U16, 65535, 5, b"\xff\xff"),
        (I16, -2, 3, b"\xfe\xff\xff\xff"),
        (FLOAT, 300.9, 1, b"\x2c"),
        (FLOAT, -1.5, 2, b"\xff\xff"),
        (FLOAT, 1e12, 6, b"\xff\xff\xff\x7f"),
        (U16, 526, 7, struct.pack("<f", 526.0)),
    ],
)
def test_whole_numbers_keep_their_low_bytes(stored, value, code, sent):
    assert packed(value, stored, LOG_TYPES[code]) == sent
