"""Port 5: log blocks."""

import errno
import struct

from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.link.crtp import Packet, Port
from crazyflie_virtual.tables.log_table import LogVariable, log_variables
from crazyflie_virtual.tables.number_types import I32, LOG_CODES, LOG_TYPES, NumberType
from crazyflie_virtual.tables.toc import Table

#: Blocks at one time, variables in all of them, bytes of values in one.
MAX_BLOCKS, MAX_VARIABLES, MAX_BYTES = 16, 128, 26

_TABLE, _CONTROL, _DATA = 0, 1, 2
_DELETE, _START, _STOP, _RESET, _CREATE, _APPEND, _START_2 = 2, 3, 4, 5, 6, 7, 8

_PERIOD_UNIT = 10  #: Of the period on the wire, ms.


def packed(value: float, stored: NumberType, sent: NumberType) -> bytes:
    """Return a variable's bytes in the type that the client asked for.

    The firmware's logRunBlock copies a whole number's low bytes, of 32 bits, without a limit.
    """
    if sent is stored or sent.is_float:
        return sent.pack(value)
    whole = int((I32 if stored.is_float else stored).convert(value))
    return (whole & 0xFFFFFFFF).to_bytes(4, "little")[: sent.size]


class _Block:
    def __init__(self) -> None:
        self.variables: list[tuple[LogVariable, NumberType | None]] = []
        self.size = 0
        self.period = 0
        self.due: int | None = None

    def add(self, variable, number_type):
        self.variables.append((variable, number_type))
        self.size += number_type.size if number_type else 0


class LogPort:
    """Sends the values of variables that the client asks for, periodically."""

    def __init__(self, firmware: Firmware):
        self._firmware = firmware
        self._variables = log_variables()
        entries = [(v.group, v.name, LOG_CODES[v.number_type]) for v in self._variables]
        self.table = Table(entries, bytes([MAX_BLOCKS, MAX_VARIABLES]))
        self._blocks: dict[int, _Block] = {}
        self._due: int | None = None
        self._once: list[_Block] = []

    def handle(self, channel: int, data: bytes) -> bytes | None:
        """Return the data of the answer; None for no answer."""
        if channel == _TABLE:
            return self.table.answer(data)
        if channel == _CONTROL and data:
            command, rest = data[0], data[1:]
            block_id = rest[0] if rest else 0
            return bytes([command, block_id, self._control(command, block_id, rest[1:])])
        return None

    def collect(self) -> list[Packet]:
        """Return the packets with values that are due."""
        now = self._firmware.milliseconds
        once, self._once = self._once, []
        packets = [self._data_packet(i, b, now) for i, b in self._blocks.items() if b in once]
        if self._due is None or now < self._due:
            return packets
        for block_id, block in self._blocks.items():
            if block.due is not None and now >= block.due:
                # The phase is kept; what was missed is skipped.
                block.due += (1 + (now - block.due) // block.period) * block.period
                packets.append(self._data_packet(block_id, block, now))
        self._schedule()
        return packets

    def _control(self, command, block_id, data):
        if command == _RESET:
            self._blocks.clear()
            self._schedule()
            return 0
        if command == _CREATE:
            if block_id in self._blocks:
                return errno.EEXIST
            if len(self._blocks) >= MAX_BLOCKS:
                return errno.ENOMEM
            # It stays, with the variables that have found a place, also after an error.
            self._blocks[block_id] = _Block()
            return self._append(self._blocks[block_id], data)
        if command not in (_APPEND, _DELETE, _START, _STOP, _START_2):
            self._firmware.warn("log", f"LOG: unknown command {command}")
            return errno.ENOEXEC
        block = self._blocks.get(block_id)
        if block is None:
            return errno.ENOENT
        if command == _APPEND:
            return self._append(block, data)
        if command == _DELETE:
            del self._blocks[block_id]
        elif command == _START:
            self._start(block, _PERIOD_UNIT * (data[0] if data else 0))
        elif command == _START_2:
            self._start(block, int.from_bytes(data[:2], "little"))
        else:
            block.due = None
        self._schedule()
        return 0

    def _start(self, block, period):
        if period == 0:
            self._once.append(block)
        else:
            block.period = period
            block.due = self._firmware.milliseconds + period

    def _append(self, block, data):
        for code, index in struct.iter_unpack("<BH", data[: len(data) // 3 * 3]):
            if index >= len(self._variables):
                return errno.ENOENT
            variable = self._variables[index]
            # The low half of the code is the type to send; of one that there is not,
            # nothing is sent.
            number_type = LOG_TYPES.get(code & 0xF)
            if number_type and block.size + number_type.size > MAX_BYTES:
                return errno.E2BIG
            if sum(len(b.variables) for b in self._blocks.values()) >= MAX_VARIABLES:
                return errno.ENOMEM
            block.add(variable, number_type)
        return 0

    def _schedule(self):
        dues = [block.due for block in self._blocks.values() if block.due is not None]
        self._due = min(dues, default=None)

    def _data_packet(self, block_id, block, now):
        firmware = self._firmware
        values = b"".join(
            packed(variable.read(firmware), variable.number_type, number_type)
            for variable, number_type in block.variables
            if number_type
        )
        stamp = (now & 0xFFFFFF).to_bytes(3, "little")
        return Packet(Port.LOG, _DATA, bytes([block_id]) + stamp + values)
