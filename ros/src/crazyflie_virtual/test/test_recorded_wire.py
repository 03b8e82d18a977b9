"""The wire protocol, compared step by step with the answers of the real firmware."""

import math
import struct

import pytest
from recording import recorded
from virtual_bench import Bench

from crazyflie_virtual.crtp import Port
from crazyflie_virtual.firmware_parameters import parameter_specs
from crazyflie_virtual.log import log_variables

TABLE, READ, WRITE, MISC = 0, 1, 2, 3
CONTROL, DATA = 1, 2
UNKNOWN = struct.pack("<H", 9999)

PARAMETERS = [f"{spec.group}.{spec.name}" for spec in parameter_specs()]
VARIABLES = [f"{variable.group}.{variable.name}" for variable in log_variables()]


def number(name):
    return struct.pack("<H", PARAMETERS.index(name))


class Client:
    """A bench, and answers as they are recorded: hexadecimal, the parameter's number as IDID."""

    def __init__(self):
        self.bench = Bench()

    def ask(self, port, channel, data, parameter=None):
        answers = [p.data for p in self.bench.ask(port, channel, data)]
        return [
            (a.hex() if parameter is None else self._anonymous(a, channel, parameter))
            for a in answers
        ]

    def _anonymous(self, answer, channel, parameter):
        at = 1 if channel == MISC else 0
        assert answer[at : at + 2] == number(parameter)
        return answer[:at].hex() + "IDID" + answer[at + 2 :].hex()

    def read(self, name):
        return self.ask(Port.PARAMETERS, READ, number(name), name)

    def write(self, name, data):
        return self.ask(Port.PARAMETERS, WRITE, number(name) + data, name)

    def misc(self, command, name):
        return self.ask(Port.PARAMETERS, MISC, bytes([command]) + number(name), name)

    def misc_unknown(self, command):
        return self.ask(Port.PARAMETERS, MISC, bytes([command]) + UNKNOWN)

    def by_name(self, name, type_and_value):
        group, parameter = name.encode().split(b".")
        data = b"\0" + group + b"\0" + parameter + b"\0" + type_and_value
        return self.ask(Port.PARAMETERS, MISC, data)

    def control(self, *data):
        return self.ask(Port.LOG, CONTROL, bytes(data))

    def data_packets(self, duration):
        self.bench.unsolicited.clear()
        self.bench.run(duration)
        packets = self.bench.unsolicited
        return len([p for p in packets if (p.port, p.channel) == (Port.LOG, DATA)])


@pytest.fixture
def client():
    return Client()


def f32(value):
    return struct.pack("<f", value)


def test_parameters(client):
    gain, flag = "pid_rate.roll_kp", "stabilizer.stop"
    read_only = "firmware.modified"
    one = f32(251.0)
    steps = {
        "read_f32": lambda: client.read(gain),
        "write_f32": lambda: client.write(gain, one),
        "read_again": lambda: client.read(gain),
        "write_short": lambda: client.write(gain, b"\1\2"),
        "read_after_short": lambda: client.read(gain),
        "write_long": lambda: client.write(gain, f32(252.0) + b"\7"),
        "read_after_long": lambda: client.read(gain),
        "write_nan": lambda: client.write(gain, f32(math.nan)),
        "read_after_nan": lambda: client.read(gain),
        "read_unknown": lambda: client.ask(Port.PARAMETERS, READ, UNKNOWN),
        "write_unknown": lambda: client.ask(Port.PARAMETERS, WRITE, UNKNOWN + one),
        "write_read_only": lambda: write_read_only(client, read_only),
        "write_u8_300_as_u16": lambda: client.write("ring.effect", struct.pack("<H", 300)),
        "name_ok": lambda: client.by_name(gain, b"\6" + f32(249.0)),
        "read_after_name": lambda: client.read(gain),
        "name_unknown": lambda: client.by_name("pid_rate.nothing", b"\6" + one),
        "name_wrong_type": lambda: client.by_name(gain, b"\x08\1"),
        "name_read_only": lambda: client.by_name(read_only, b"\x08\1"),
        "ext_type_v2": lambda: client.misc(7, gain),
        "ext_type_v2_unknown": lambda: client.misc_unknown(7),
        "ext_v1": lambda: client.misc(2, gain),
        "default_v1": lambda: client.misc(6, gain),
        "default_v2": lambda: client.misc(8, gain),
        "default_v2_unknown": lambda: client.misc_unknown(8),
        "default_v2_read_only_len": lambda: [
            len(bytes.fromhex(a.replace("IDID", "0000"))) for a in client.misc(8, read_only)
        ],
        "state0": lambda: client.misc(4, gain),
        "store": lambda: (client.write(gain, f32(255.0)), client.misc(3, gain))[1],
        "state1": lambda: client.misc(4, gain),
        "clear": lambda: client.misc(5, gain),
        "state2": lambda: client.misc(4, gain),
        "clear_again": lambda: client.misc(5, gain),
        "store_not_persistent": lambda: client.misc(3, flag),
        "state_not_persistent": lambda: client.misc(4, flag),
        "misc_unknown": lambda: client.misc(99, gain),
    }
    firmware = recorded("parameters")
    assert list(steps) == list(firmware)
    answers = {name: step() for name, step in steps.items()}
    # For a short write, the firmware also stores the old bytes of its buffer.
    for column in (answers, firmware := dict(firmware)):
        column["read_after_short"] = [a[:10] for a in column["read_after_short"]]
    assert answers == firmware


def write_read_only(client, name):
    before = client.read(name)
    answers = client.write(name, b"\1")
    return {
        "reply_len": [len(a) for a in answers],
        "reply_is_error_byte": "value",
        "changed": client.read(name) != before,
    }


def test_log_errors(client):
    def variable(name, code):
        return struct.pack("<BH", code, VARIABLES.index(name))

    u8, single = variable("sys.canfly", 1), variable("acc.x", 7)
    control = client.control

    def created(variables, count):
        control(5)
        return [control(6, block, *variables)[0][4:] for block in range(count)]

    steps = {
        "reset": lambda: control(5),
        "unknown_variable": lambda: control(6, 0x32, 7, 0xF0, 0xF0),
        "start_after_unknown": lambda: control(3, 0x32, 10),
        "delete_it": lambda: control(2, 0x32),
        "create_6_floats": lambda: control(6, 0x33, *single * 6),
        "append_1_float_28_bytes": lambda: control(7, 0x33, *single),
        "append_u8_25": lambda: control(7, 0x33, *u8),
        "append_fp16_27": lambda: control(7, 0x33, *variable("acc.x", 8)),
        "duplicate": lambda: control(6, 0x33, *u8),
        "create_empty": lambda: control(6, 0x34),
        "start_empty": lambda: control(3, 0x34, 10),
        "stop_empty": lambda: control(4, 0x34),
        "period_0": lambda: control(3, 0x33, 0),
        "data_with_period_0": lambda: client.data_packets(0.5),
        "start_unknown": lambda: control(3, 0x63, 10),
        "stop_unknown": lambda: control(4, 0x63),
        "delete_unknown": lambda: control(2, 0x63),
        "append_unknown": lambda: control(7, 0x63, *u8),
        "unknown_command": lambda: control(0x2C, 1),
        "type_mismatch_u8": lambda: control(6, 0x3C, *variable("acc.x", 1)),
        "type_0": lambda: control(6, 0x3D, *variable("acc.x", 0)),
        "type_9": lambda: control(6, 0x3E, *variable("acc.x", 9)),
        "18_blocks_errno": lambda: created(u8, 18),
        "15_blocks_of_9_u8_errno": lambda: created(u8 * 9, 15),
        "create": lambda: (control(5), control(6, 5, *single))[1],
        "start_10ms": lambda: control(3, 5, 1),
        "packets_in_1s_at_10ms": lambda: client.data_packets(0.999),
        "start_again_200ms": lambda: control(3, 5, 20),
        "packets_in_1s_at_200ms": lambda: client.data_packets(1.001),
        "delete": lambda: control(2, 5),
        "packets_after_delete": lambda: client.data_packets(0.5),
    }
    firmware = recorded("log_errors")
    assert list(steps) == list(firmware)
    answers = {name: step() for name, step in steps.items()}
    # The answer to a reset has in the block's place what the buffer held.
    for column in (answers, firmware := dict(firmware)):
        column["reset"] = [a[:2] + a[4:] for a in column["reset"]]
    assert answers == firmware


def test_link(client):
    def ask(port, channel, data):
        return client.bench.ask(port, channel, data)

    def text(packets):
        return [p.data.rstrip(b"\0").decode() for p in packets]

    everything = bytes(range(30))
    answers = {
        "echo_0": client.ask(Port.LINK, 0, b""),
        "echo_1": client.ask(Port.LINK, 0, b"\x42"),
        "echo_30": [p.data for p in ask(Port.LINK, 0, everything)] == [everything],
        "source": text(ask(Port.LINK, 1, b"")),
        "sink": client.ask(Port.LINK, 2, b"\1\2\3"),
        "protocol": client.ask(Port.PLATFORM, 1, b"\0"),
        "version_unknown": client.ask(Port.PLATFORM, 1, b"\x63"),
        "port_10": client.ask(10, 0, b"\1\2\3"),
    }
    firmware = recorded("link")
    assert answers == {name: firmware[name] for name in answers}
    (release,) = text(ask(Port.PLATFORM, 1, b"\1"))
    # The text after the release's name belongs to the build.
    assert release[1:].split()[0] == firmware["firmware"][0].split()[0]
    sizes = {p.data[2]: p.data[3:7] for i in range(7) for p in ask(Port.MEMORY, 0, bytes([2, i]))}
    for memory_type, size in firmware["memories"]:
        assert struct.unpack("<I", sizes[memory_type]) == (size,)


def test_log_rate_of_the_link(client):
    client.control(6, 1, *struct.pack("<BH", 7, VARIABLES.index("acc.z")))
    client.control(3, 1, 2)
    assert client.data_packets(1.0) == recorded("link")["log_20ms_rate_hz"]


def test_memory(client):
    bench = client.bench
    numbers = [bench.ask_one(Port.MEMORY, 0, bytes([2, i]))[2] for i in range(7)]
    trajectory = numbers.index(0x12)

    def answer(channel, address, rest):
        data = struct.pack("<BI", trajectory, address) + rest
        # Recorded without the memory's number.
        return [a[2:] for a in client.ask(Port.MEMORY, channel, data)]

    def is_alive():
        return client.ask(Port.LINK, 0, b"\x42") == ["42"]

    content = bytes(range(24))
    answers = {
        "write": answer(2, 0, content),
        "read24": answer(1, 0, b"\x18"),
        "write_last": answer(2, 4072, content),
        "alive1": is_alive(),
        "write_beyond": answer(2, 4090, content),
        "alive2": is_alive(),
        "read_beyond": answer(1, 4090, b"\x18"),
        "alive3": is_alive(),
    }
    assert answers == recorded("memory")


def test_read_of_more_than_a_packet_holds_is_not_answered(client):
    data = struct.pack("<BIB", 1, 0, 25)
    assert client.ask(Port.MEMORY, 1, data) == recorded("memory_read_25")["read25"]
