"""The log variables, with the firmware's names and types, and port 5, which sends log blocks."""

import errno
import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import NamedTuple

from crazyflie_virtual.crtp import Packet, Port
from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.firmware.states import MOTION
from crazyflie_virtual.toc import (
    ATTITUDE_PIDS,
    FLOAT,
    I8,
    I16,
    I32,
    LOG_TYPES,
    RATE_PIDS,
    U8,
    U16,
    U32,
    NumberType,
    Table,
    pid_paths,
)

Read = Callable[[Firmware], float]  #: Returns a value.


class LogVariable(NamedTuple):
    """A log variable."""

    group: str
    name: str
    number_type: NumberType
    read: Read  #: ``read(firmware)`` returns the value.


def log_variables() -> list[LogVariable]:
    """Return all log variables, in the order of their numbers."""
    return [LogVariable(group, *row) for group, rows in _GROUPS.items() for row in rows]


def _rows(
    number_type: NumberType, scale: float | None = None, /, **sources: str | float
) -> list[tuple[str, NumberType, Read]]:
    # Name -> path from the firmware, or a constant for quantities that the virtual vehicle does not
    # have.
    def reader(source: str | float) -> Read:
        if not isinstance(source, str):
            return lambda firmware: source
        read: Read = attrgetter(source)
        return read if scale is None else lambda firmware: scale * read(firmware)

    return [(name, number_type, reader(source)) for name, source in sources.items()]


def _of(owner: str, *names: str) -> dict[str, str]:
    # Attributes under their own names.
    return {name: f"{owner}.{name}" for name in names}


def _pids(owner, suffixes, **pids):
    outputs = ("out_p", "out_i", "out_d", "out_ff")
    return _rows(FLOAT, **pid_paths(owner, pids, suffixes, outputs))


def _range(side: str) -> Read:
    return lambda firmware: firmware.ranging.distance(side)


_ANGLES = ("roll", "pitch", "yaw")
_QUATERNION = ("qx", "qy", "qz", "qw")

_ATTITUDE_OUTPUTS = ("_outP", "_outI", "_outD", "_outFF")

_RADIAN = math.pi / 180.0
_MILLIRADIAN = 1000.0 * _RADIAN
_STANDARD_GRAVITY = 9810.0  #: mm/s^2.

#: Group -> (name, type, value).
_GROUPS: dict[str, list[tuple[str, NumberType, Read]]] = {
    "stateEstimate": _rows(FLOAT, **_of("estimate", *MOTION, *_ANGLES, *_QUATERNION)),
    "stateEstimateZ": [
        *_rows(I16, 1000.0, **_of("estimate", *MOTION[:6])),
        *_rows(I16, _STANDARD_GRAVITY, **_of("estimate", "ax", "ay")),
        # With gravity, unlike stateEstimate.az.
        ("az", I16, lambda f: _STANDARD_GRAVITY * (f.estimate.az + 1.0)),
        *_rows(U32, quat="estimate.compressed_quaternion"),
        *_rows(I16, _MILLIRADIAN, rateRoll="sensors.gyro_x"),
        *_rows(I16, -_MILLIRADIAN, ratePitch="sensors.gyro_y"),
        *_rows(I16, _MILLIRADIAN, rateYaw="sensors.gyro_z"),
    ],
    "stabilizer": [
        *_rows(FLOAT, **_of("estimate", *_ANGLES), thrust="stabilizer.thrust", rtStab=500.0),
        *_rows(U32, intToOut=0),
    ],
    "ctrltarget": _rows(
        FLOAT, **_of("setpoint", *MOTION, "roll", "pitch"), yaw="setpoint.yaw_rate"
    ),
    "ctrltargetZ": _rows(I16, 1000.0, **_of("setpoint", *MOTION)),
    "acc": _rows(FLOAT, x="sensors.acc_x", y="sensors.acc_y", z="sensors.acc_z"),
    "gyro": _rows(FLOAT, x="sensors.gyro_x", y="sensors.gyro_y", z="sensors.gyro_z"),
    "mag": _rows(FLOAT, x="sensors.mag_x", y="sensors.mag_y", z="sensors.mag_z"),
    "range": [
        (side, U16, _range(side)) for side in ("front", "back", "up", "left", "right", "zrange")
    ],
    "baro": _rows(
        FLOAT, asl="sensors.asl", temp="sensors.temperature", pressure="sensors.pressure"
    ),
    "pm": [
        *_rows(FLOAT, vbat="power.voltage"),
        *_rows(U16, vbatMV="power.millivolts"),
        *_rows(FLOAT, extVbat=0.0),
        *_rows(U16, extVbatMV=0),
        *_rows(FLOAT, extCurr=0.0, chargeCurrent=0.0),
        *_rows(I8, state="power.state"),
        *_rows(U8, batteryLevel="power.level"),
    ],
    "radio": [
        *_rows(U8, rssi=40, isConnected="link_statistics.is_connected"),
        *_rows(
            U16, numRxBc="link_statistics.received_broadcasts", numRxUc="link_statistics.received"
        ),
    ],
    "motor": [
        *_rows(U16, **{f"m{i}": f"stabilizer.commands.m{i}" for i in range(1, 5)}),
        *_rows(I32, **{f"m{i}req": f"stabilizer.requested.m{i}" for i in range(1, 5)}),
    ],
    "supervisor": [*_rows(U16, info="info"), *_rows(FLOAT, accNorm="supervisor.acceleration")],
    "sys": [
        *_rows(
            U8,
            canfly="supervisor.can_fly",
            isFlying="supervisor.is_flying",
            isTumbled="supervisor.is_tumbled",
        ),
        *_rows(I8, armed="supervisor.is_armed"),
    ],
    "health": [
        *_rows(FLOAT, **{f"motorVar{axis}M{i}": 0.0 for i in range(1, 5) for axis in "XY"}),
        *_rows(U8, motorPass="health.motors_passed"),
        *_rows(FLOAT, batterySag="health.battery_sag"),
        *_rows(U8, batteryPass="health.battery_passed"),
        *_rows(U16, motorTestCount="health.tests"),
    ],
    "ring": _rows(FLOAT, fadeTime=0.5),
    "kalman": _rows(
        FLOAT,
        **{"stateX": "estimate.x", "stateY": "estimate.y", "stateZ": "estimate.z"},
        **{"statePX": "estimate.vx", "statePY": "estimate.vy", "statePZ": "estimate.vz"},
        **{f"stateD{i}": 0.0 for i in range(3)},
        **{f"var{axis}": "estimator.variance_position" for axis in "XYZ"},
        **{f"varP{axis}": "variance_velocity" for axis in "XY"},
        **{"varPZ": "estimator.variance_velocity"},
        **{f"varD{i}": "estimator.variance_attitude" for i in range(3)},
        **{"q0": "estimate.qw", "q1": "estimate.qx", "q2": "estimate.qy", "q3": "estimate.qz"},
        **{"rtUpdate": 100.0, "rtPred": 500.0, "rtFinal": 500.0},
    ),
    "locSrv": _rows(FLOAT, **_of("localization", "x", "y", "z", *_QUATERNION)),
    "locSrvZ": _rows(U16, tick="localization.milliseconds"),
    "ext_pos": _rows(FLOAT, X="localization.x", Y="localization.y", Z="localization.z"),
    "controller": [
        *_rows(
            FLOAT,
            cmd_thrust="stabilizer.thrust",
            cmd_roll="stabilizer.command_roll",
            cmd_pitch="stabilizer.command_pitch",
        ),
        *_rows(FLOAT, -1.0, cmd_yaw="stabilizer.command_yaw"),
        *_rows(FLOAT, _RADIAN, r_roll="sensors.gyro_x"),
        *_rows(FLOAT, -_RADIAN, r_pitch="sensors.gyro_y"),
        *_rows(FLOAT, _RADIAN, r_yaw="sensors.gyro_z"),
        *_rows(
            FLOAT,
            accelz="sensors.acc_z",
            actuatorThrust="stabilizer.thrust",
            **_of("stabilizer", *_ANGLES),
            rollRate="stabilizer.roll_rate",
            pitchRate="stabilizer.pitch_rate",
            yawRate="stabilizer.yaw_rate",
        ),
        *_rows(I16, -1.0, ctr_yaw="stabilizer.command_yaw"),
    ],
    "pid_attitude": _pids("stabilizer.attitude", _ATTITUDE_OUTPUTS, **ATTITUDE_PIDS),
    "pid_rate": _pids("stabilizer.attitude", _ATTITUDE_OUTPUTS, **RATE_PIDS),
    "posCtl": [
        *_rows(
            FLOAT,
            **{
                f"target{pid.upper()}": f"stabilizer.position.{pid}.desired"
                for pid in ("vx", "vy", "vz", "x", "y", "z")
            },
            bodyVX="stabilizer.position.body_vx",
            bodyVY="stabilizer.position.body_vy",
            bodyX="stabilizer.position.body_x",
            bodyY="stabilizer.position.body_y",
        ),
        *_pids(
            "stabilizer.position",
            ("p", "i", "d", "ff"),
            **{pid.upper(): pid for pid in ("x", "y", "z", "vx", "vy", "vz")},
        ),
    ],
    "lighthouse": _rows(
        U16,
        bsReceive="deck.received",
        bsActive="deck.active_stations",
        bsAvailable="deck.active_stations",
        bsGeoVal="deck.located_stations",
        bsCalVal="deck.calibrated_stations",
    ),
    "memTst": _rows(U32, errCntW="memory_tester.errors"),
    "crtp": _rows(U16, rxRate="link_statistics.received_rate", txRate="link_statistics.sent_rate"),
}


#: Blocks at one time, variables in all of them, bytes of values in one.
MAX_BLOCKS, MAX_VARIABLES, MAX_BYTES = 16, 128, 26

_TABLE, _CONTROL, _DATA = 0, 1, 2
_DELETE, _START, _STOP, _RESET, _CREATE, _APPEND, _START_2 = 2, 3, 4, 5, 6, 7, 8

_PERIOD_UNIT = 10  #: Unit of the period on the wire (ms).


def packed(value: float, stored: NumberType, sent: NumberType) -> bytes:
    """Return a variable's bytes in the requested type.

    The firmware's logRunBlock copies the low bytes of a 32-bit integer, without a limit.
    """
    if sent is stored or sent.is_float:
        return sent.pack(value)
    whole = int((I32 if stored.is_float else stored).convert(value))
    return (whole & 0xFFFFFFFF).to_bytes(4, "little")[: sent.size]


@dataclass(eq=False)
class _Block:
    variables: list[tuple[LogVariable, NumberType | None]] = field(default_factory=list)
    period: int = 0  # ms.
    due: int | None = None  # ms; None for a block that is not started.

    @property
    def size(self):
        return sum(sent.size for _, sent in self.variables if sent)


class LogPort:
    """Sends the values of requested variables periodically."""

    def __init__(self, firmware: Firmware, variables: Sequence[LogVariable]):
        self._firmware = firmware
        self._variables = variables
        entries = [(v.group, v.name, v.number_type.log_code) for v in self._variables]
        self.table = Table(entries, bytes([MAX_BLOCKS, MAX_VARIABLES]))
        self._blocks: dict[int, _Block] = {}
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
        for block_id, block in self._blocks.items():
            if block.due is not None and now >= block.due:
                # The phase is kept; missed values are skipped.
                block.due += (1 + (now - block.due) // block.period) * block.period
                packets.append(self._data_packet(block_id, block, now))
        return packets

    def _control(self, command, block_id, data):
        if command == _RESET:
            self._blocks.clear()
            return 0
        if command == _CREATE:
            if block_id in self._blocks:
                return errno.EEXIST
            if len(self._blocks) >= MAX_BLOCKS:
                return errno.ENOMEM
            # After an error, the block remains with the variables that were accepted.
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
            # The low half of the code is the type to send; nothing is sent for an unknown type.
            number_type = LOG_TYPES.get(code & 0xF)
            if number_type and block.size + number_type.size > MAX_BYTES:
                return errno.E2BIG
            if sum(len(b.variables) for b in self._blocks.values()) >= MAX_VARIABLES:
                return errno.ENOMEM
            block.variables.append((variable, number_type))
        return 0

    def _data_packet(self, block_id, block, now):
        firmware = self._firmware
        values = b"".join(
            packed(variable.read(firmware), variable.number_type, number_type)
            for variable, number_type in block.variables
            if number_type
        )
        stamp = (now & 0xFFFFFF).to_bytes(3, "little")
        return Packet(Port.LOG, _DATA, bytes([block_id]) + stamp + values)
