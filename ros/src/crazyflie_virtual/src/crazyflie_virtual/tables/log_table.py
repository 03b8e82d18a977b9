"""The log variables: names and types of the firmware's, and where their values are."""

import math
from collections.abc import Callable
from operator import attrgetter
from typing import NamedTuple

from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.firmware.states import MOTION
from crazyflie_virtual.tables.number_types import FLOAT, I8, I16, I32, U8, U16, U32, NumberType
from crazyflie_virtual.tables.toc import pid_paths

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
    # Name -> path from the firmware, or a number where the virtual vehicle has nothing to measure.
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
    outputs = dict(zip(suffixes, ("out_p", "out_i", "out_d", "out_ff"), strict=True))
    return _rows(FLOAT, **dict(pid_paths(owner, pids, outputs)))


def _range(side: str) -> Read:
    return lambda firmware: firmware.ranging.distance(side)


_ANGLES = ("roll", "pitch", "yaw")
_QUATERNION = ("qx", "qy", "qz", "qw")

_ATTITUDE_OUTPUTS = ("_outP", "_outI", "_outD", "_outFF")
_POSITION_OUTPUTS = ("p", "i", "d", "ff")

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
    "supervisor": _rows(U16, info="info"),
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
        *_rows(U8, motorPass=0),
        *_rows(FLOAT, batterySag=0.0),
        *_rows(U8, batteryPass=0),
        *_rows(U16, motorTestCount=0),
    ],
    "ring": _rows(FLOAT, fadeTime=0.5),
    "kalman": _rows(
        FLOAT,
        **{"stateX": "estimate.x", "stateY": "estimate.y", "stateZ": "estimate.z"},
        **{"statePX": "estimate.vx", "statePY": "estimate.vy", "statePZ": "estimate.vz"},
        **{f"stateD{i}": 0.0 for i in range(3)},
        **{f"var{axis}": "estimator.variance_position" for axis in "XYZ"},
        **{f"varP{axis}": "estimator.variance_velocity" for axis in "XYZ"},
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
    "pid_attitude": _pids(
        "stabilizer.attitude", _ATTITUDE_OUTPUTS, roll="roll", pitch="pitch", yaw="yaw"
    ),
    "pid_rate": _pids(
        "stabilizer.attitude",
        _ATTITUDE_OUTPUTS,
        roll="roll_rate",
        pitch="pitch_rate",
        yaw="yaw_rate",
    ),
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
            _POSITION_OUTPUTS,
            **{pid.upper(): pid for pid in ("x", "y", "z", "vx", "vy", "vz")},
        ),
    ],
    "lighthouse": _rows(U16, bsReceive=0, bsActive=0, bsAvailable=0, bsGeoVal=0, bsCalVal=0),
    "memTst": _rows(U32, errCntW="memory_tester.errors"),
    "crtp": _rows(U16, rxRate="link_statistics.received_rate", txRate="link_statistics.sent_rate"),
}
