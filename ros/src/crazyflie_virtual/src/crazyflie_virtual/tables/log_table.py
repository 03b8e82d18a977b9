"""The log variables: names and types of the firmware's, and where their values are."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.tables.number_types import FLOAT, I8, I16, I32, U8, U16, U32, NumberType

Read = Callable[[Firmware], float]
"""Returns a value."""

Rows = list[tuple[str, NumberType, Read]]
"""Name, type and value of some variables of a group."""


class LogVariable(NamedTuple):
    """A log variable.

    Attributes
    ----------
    group, name : str
    number_type : NumberType
    read : callable
        ``read(firmware)`` returns the value.
    """

    group: str
    name: str
    number_type: NumberType
    read: Read


def log_variables() -> list[LogVariable]:
    """Return all log variables, in the order of their numbers."""
    return [LogVariable(group, *row) for group, rows in _GROUPS.items() for row in rows]


def _constant(value: float) -> Read:
    # Where the virtual vehicle has nothing to measure.
    return lambda firmware: value


def _attributes(
    number_type: NumberType,
    names: Mapping[str, str] | Iterable[str],
    owner: Callable[[Firmware], Any],
    scale: float | None = None,
) -> Rows:
    # Attributes of a part of the firmware, under their own names or as name -> attribute.
    def read(attribute: str) -> Read:
        if scale is None:
            return lambda firmware: getattr(owner(firmware), attribute)
        return lambda firmware: scale * getattr(owner(firmware), attribute)

    pairs = names.items() if isinstance(names, Mapping) else ((name, name) for name in names)
    return [(name, number_type, read(attribute)) for name, attribute in pairs]


def _pids(suffixes: Iterable[str], **pids: Callable[[Firmware], Any]) -> Rows:
    # Outputs of PID controllers under the firmware's names, such as roll_outP.
    attributes = dict(zip(suffixes, ("out_p", "out_i", "out_d", "out_ff"), strict=True))
    return [
        row
        for axis, pid in pids.items()
        for row in _attributes(FLOAT, {axis + s: a for s, a in attributes.items()}, pid)
    ]


def _estimate(firmware: Firmware) -> Any:
    return firmware.estimate


def _setpoint(firmware: Firmware) -> Any:
    return firmware.setpoint


def _sensors(firmware: Firmware) -> Any:
    return firmware.sensors


def _stabilizer(firmware: Firmware) -> Any:
    return firmware.stabilizer


def _localization(firmware: Firmware) -> Any:
    return firmware.localization


def _motor(i: int) -> Read:
    return lambda firmware: firmware.stabilizer.commands[i]


def _motor_request(i: int) -> Read:
    return lambda firmware: firmware.stabilizer.requested[i]


_MOTION = ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az")
_ANGLES = ("roll", "pitch", "yaw")
_QUATERNION = ("qx", "qy", "qz", "qw")

_ATTITUDE_OUTPUTS = ("_outP", "_outI", "_outD", "_outFF")
_POSITION_OUTPUTS = ("p", "i", "d", "ff")

_RADIAN = math.pi / 180.0
_MILLIRADIAN = 1000.0 * _RADIAN

_GROUPS: dict[str, Rows] = {
    "stateEstimate": _attributes(FLOAT, (*_MOTION, *_ANGLES, *_QUATERNION), _estimate),
    "stateEstimateZ": [
        *_attributes(I16, _MOTION[:6], _estimate, 1000.0),
        *_attributes(I16, _MOTION[6:8], _estimate, 9810.0),
        # With gravity, unlike stateEstimate.az.
        ("az", I16, lambda f: 9810.0 * (f.estimate.az + 1.0)),
        ("quat", U32, lambda f: f.estimate.compressed_quaternion),
        ("rateRoll", I16, lambda f: _MILLIRADIAN * f.sensors.gyro_x),
        ("ratePitch", I16, lambda f: -_MILLIRADIAN * f.sensors.gyro_y),
        ("rateYaw", I16, lambda f: _MILLIRADIAN * f.sensors.gyro_z),
    ],
    "stabilizer": [
        *_attributes(FLOAT, _ANGLES, _estimate),
        ("thrust", FLOAT, lambda f: f.stabilizer.thrust),
        ("rtStab", FLOAT, _constant(500.0)),
        ("intToOut", U32, _constant(0)),
    ],
    "ctrltarget": [
        *_attributes(FLOAT, (*_MOTION, "roll", "pitch"), _setpoint),
        ("yaw", FLOAT, lambda f: f.setpoint.yaw_rate),
    ],
    "ctrltargetZ": _attributes(I16, _MOTION, _setpoint, 1000.0),
    "acc": _attributes(FLOAT, {"x": "acc_x", "y": "acc_y", "z": "acc_z"}, _sensors),
    "gyro": _attributes(FLOAT, {"x": "gyro_x", "y": "gyro_y", "z": "gyro_z"}, _sensors),
    "mag": _attributes(FLOAT, {"x": "mag_x", "y": "mag_y", "z": "mag_z"}, _sensors),
    "range": _attributes(
        U16, ("front", "back", "up", "left", "right", "zrange"), lambda f: f.ranging
    ),
    "baro": [
        ("asl", FLOAT, lambda f: f.sensors.asl),
        ("temp", FLOAT, lambda f: f.sensors.temperature),
        ("pressure", FLOAT, lambda f: f.sensors.pressure),
    ],
    "pm": [
        ("vbat", FLOAT, lambda f: f.power.voltage),
        ("vbatMV", U16, lambda f: f.power.millivolts),
        ("extVbat", FLOAT, _constant(0.0)),
        ("extVbatMV", U16, _constant(0)),
        ("extCurr", FLOAT, _constant(0.0)),
        ("chargeCurrent", FLOAT, _constant(0.0)),
        ("state", I8, lambda f: f.power.state),
        ("batteryLevel", U8, lambda f: f.power.level),
    ],
    "radio": [
        ("rssi", U8, _constant(40)),
        ("isConnected", U8, lambda f: f.link_statistics.is_connected),
        ("numRxBc", U16, _constant(0)),
        ("numRxUc", U16, lambda f: f.link_statistics.received),
    ],
    "motor": [
        *((f"m{i + 1}", U16, _motor(i)) for i in range(4)),
        *((f"m{i + 1}req", I32, _motor_request(i)) for i in range(4)),
    ],
    "supervisor": [("info", U16, lambda f: f.info)],
    "sys": [
        ("canfly", U8, lambda f: f.supervisor.can_fly),
        ("isFlying", U8, lambda f: f.supervisor.is_flying),
        ("isTumbled", U8, lambda f: f.supervisor.is_tumbled),
        ("armed", I8, lambda f: f.supervisor.is_armed),
    ],
    "health": [
        *((f"motorVar{a}M{i}", FLOAT, _constant(0.0)) for i in range(1, 5) for a in "XY"),
        ("motorPass", U8, _constant(0)),
        ("batterySag", FLOAT, _constant(0.0)),
        ("batteryPass", U8, _constant(0)),
        ("motorTestCount", U16, _constant(0)),
    ],
    "ring": [("fadeTime", FLOAT, _constant(0.5))],
    "kalman": [
        *_attributes(FLOAT, {"stateX": "x", "stateY": "y", "stateZ": "z"}, _estimate),
        *_attributes(FLOAT, {"statePX": "vx", "statePY": "vy", "statePZ": "vz"}, _estimate),
        *((f"stateD{i}", FLOAT, _constant(0.0)) for i in range(3)),
        *((f"var{a}", FLOAT, lambda f: f.estimator.variance_position) for a in "XYZ"),
        *((f"varP{a}", FLOAT, lambda f: f.estimator.variance_velocity) for a in "XYZ"),
        *((f"varD{i}", FLOAT, lambda f: f.estimator.variance_attitude) for i in range(3)),
        *_attributes(FLOAT, {"q0": "qw", "q1": "qx", "q2": "qy", "q3": "qz"}, _estimate),
        ("rtUpdate", FLOAT, _constant(100.0)),
        ("rtPred", FLOAT, _constant(500.0)),
        ("rtFinal", FLOAT, _constant(500.0)),
    ],
    "locSrv": _attributes(FLOAT, ("x", "y", "z", *_QUATERNION), _localization),
    "locSrvZ": [("tick", U16, lambda f: f.localization.milliseconds)],
    "ext_pos": _attributes(FLOAT, {"X": "x", "Y": "y", "Z": "z"}, _localization),
    "controller": [
        ("cmd_thrust", FLOAT, lambda f: f.stabilizer.thrust),
        ("cmd_roll", FLOAT, lambda f: f.stabilizer.command_roll),
        ("cmd_pitch", FLOAT, lambda f: f.stabilizer.command_pitch),
        ("cmd_yaw", FLOAT, lambda f: -f.stabilizer.command_yaw),
        ("r_roll", FLOAT, lambda f: _RADIAN * f.sensors.gyro_x),
        ("r_pitch", FLOAT, lambda f: -_RADIAN * f.sensors.gyro_y),
        ("r_yaw", FLOAT, lambda f: _RADIAN * f.sensors.gyro_z),
        ("accelz", FLOAT, lambda f: f.sensors.acc_z),
        ("actuatorThrust", FLOAT, lambda f: f.stabilizer.thrust),
        *_attributes(FLOAT, _ANGLES, _stabilizer),
        ("rollRate", FLOAT, lambda f: f.stabilizer.roll_rate),
        ("pitchRate", FLOAT, lambda f: f.stabilizer.pitch_rate),
        ("yawRate", FLOAT, lambda f: f.stabilizer.yaw_rate),
        ("ctr_yaw", I16, lambda f: -f.stabilizer.command_yaw),
    ],
    "pid_attitude": _pids(
        _ATTITUDE_OUTPUTS,
        roll=lambda f: f.stabilizer.attitude.roll,
        pitch=lambda f: f.stabilizer.attitude.pitch,
        yaw=lambda f: f.stabilizer.attitude.yaw,
    ),
    "pid_rate": _pids(
        _ATTITUDE_OUTPUTS,
        roll=lambda f: f.stabilizer.attitude.roll_rate,
        pitch=lambda f: f.stabilizer.attitude.pitch_rate,
        yaw=lambda f: f.stabilizer.attitude.yaw_rate,
    ),
    "posCtl": [
        ("targetVX", FLOAT, lambda f: f.stabilizer.position.vx.desired),
        ("targetVY", FLOAT, lambda f: f.stabilizer.position.vy.desired),
        ("targetVZ", FLOAT, lambda f: f.stabilizer.position.vz.desired),
        ("targetX", FLOAT, lambda f: f.stabilizer.position.x.desired),
        ("targetY", FLOAT, lambda f: f.stabilizer.position.y.desired),
        ("targetZ", FLOAT, lambda f: f.stabilizer.position.z.desired),
        ("bodyVX", FLOAT, lambda f: f.stabilizer.position.body_vx),
        ("bodyVY", FLOAT, lambda f: f.stabilizer.position.body_vy),
        ("bodyX", FLOAT, lambda f: f.stabilizer.position.body_x),
        ("bodyY", FLOAT, lambda f: f.stabilizer.position.body_y),
        *_pids(
            _POSITION_OUTPUTS,
            X=lambda f: f.stabilizer.position.x,
            Y=lambda f: f.stabilizer.position.y,
            Z=lambda f: f.stabilizer.position.z,
            VX=lambda f: f.stabilizer.position.vx,
            VY=lambda f: f.stabilizer.position.vy,
            VZ=lambda f: f.stabilizer.position.vz,
        ),
    ],
    "lighthouse": [
        (name, U16, _constant(0))
        for name in ("bsReceive", "bsActive", "bsAvailable", "bsGeoVal", "bsCalVal")
    ],
    "memTst": [("errCntW", U32, lambda f: f.memory_tester.errors)],
    "crtp": [
        ("rxRate", U16, lambda f: f.link_statistics.received_rate),
        ("txRate", U16, lambda f: f.link_statistics.sent_rate),
    ],
}
"""Group -> (name, type, value)."""
