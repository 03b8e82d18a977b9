"""The log variables: names and types of the firmware's, and where their values are.

A value is a dotted path from the `Firmware`, which may end in an index or in a
factor, such as ``estimate.x*1000``; or a constant, where the virtual vehicle has
nothing to measure.
"""

from collections.abc import Callable
from operator import attrgetter
from typing import NamedTuple

from crazyflie_virtual.tables.number_types import FLOAT, I8, I16, I32, U8, U16, U32, NumberType

_XYZ = ("x", "y", "z")


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
    read: Callable


def log_variables() -> list:
    """Return all log variables, in the order of their numbers."""
    return [
        LogVariable(group, name, number_type, _reader(source))
        for group, variables in _GROUPS.items()
        for name, number_type, source in variables
    ]


def _reader(source) -> Callable:
    if not isinstance(source, str):
        return lambda firmware: source
    path, _, index = source.removesuffix("]").partition("[")
    if index:
        get, i = attrgetter(path), int(index)
        return lambda firmware: get(firmware)[i]
    path, _, scale = path.partition("*")
    get = attrgetter(path)
    if not scale:
        return get
    factor = float(scale)
    return lambda firmware: factor * get(firmware)


def _fields(number_type, names, path, scale=""):
    # "x vx" of "estimate" are estimate.x and estimate.vx; "yaw:yaw_rate" renames.
    rows = []
    for name in names.split():
        shown, _, field = name.partition(":")
        rows.append((shown, number_type, f"{path}.{field or shown}{scale}"))
    return rows


def _pid(names, path):
    # Outputs of a PID controller under the firmware's names, such as roll_outP.
    rows = []
    for prefix, field in names:
        for part in ("P", "I", "D", "FF"):
            rows.append((f"{prefix}_out{part}", FLOAT, f"{path}.{field}.out_{part.lower()}"))
    return rows


def _position_pid(prefix, field):
    return [
        (f"{prefix}{part}", FLOAT, f"stabilizer.position.{field}.out_{part}")
        for part in ("p", "i", "d", "ff")
    ]


_ANGLES = (("roll", "roll"), ("pitch", "pitch"), ("yaw", "yaw"))
_RATES = (("roll", "roll_rate"), ("pitch", "pitch_rate"), ("yaw", "yaw_rate"))

_GROUPS = {
    "stateEstimate": _fields(
        FLOAT, "x y z vx vy vz ax ay az roll pitch yaw qx qy qz qw", "estimate"
    ),
    "stateEstimateZ": [
        *_fields(I16, "x y z vx vy vz", "estimate", "*1000"),
        *_fields(I16, "ax ay az", "estimate", "*9810"),
        ("quat", U32, "estimate.compressed_quaternion"),
        ("rateRoll", I16, "sensors.gyro_x*17.453292519943297"),
        ("ratePitch", I16, "sensors.gyro_y*-17.453292519943297"),
        ("rateYaw", I16, "sensors.gyro_z*17.453292519943297"),
    ],
    "stabilizer": [
        *_fields(FLOAT, "roll pitch yaw", "estimate"),
        ("thrust", FLOAT, "stabilizer.thrust"),
        ("rtStab", FLOAT, 500.0),
        ("intToOut", U32, 0),
    ],
    "ctrltarget": _fields(FLOAT, "x y z vx vy vz ax ay az roll pitch yaw:yaw_rate", "setpoint"),
    "ctrltargetZ": _fields(I16, "x y z vx vy vz ax ay az", "setpoint", "*1000"),
    "acc": _fields(FLOAT, "x:acc_x y:acc_y z:acc_z", "sensors"),
    "gyro": _fields(FLOAT, "x:gyro_x y:gyro_y z:gyro_z", "sensors"),
    "mag": _fields(FLOAT, "x:mag_x y:mag_y z:mag_z", "sensors"),
    "baro": _fields(FLOAT, "asl temp:temperature pressure", "sensors"),
    "pm": [
        ("vbat", FLOAT, "power.voltage"),
        ("vbatMV", U16, "power.millivolts"),
        ("extVbat", FLOAT, 0.0),
        ("extVbatMV", U16, 0),
        ("extCurr", FLOAT, 0.0),
        ("chargeCurrent", FLOAT, 0.0),
        ("state", I8, "power.state"),
        ("batteryLevel", U8, "power.level"),
    ],
    "radio": [
        ("rssi", U8, 40),
        ("isConnected", U8, "link_statistics.is_connected"),
        ("numRxBc", U16, 0),
        ("numRxUc", U16, "link_statistics.received"),
    ],
    "motor": [
        *((f"m{i + 1}", U16, f"stabilizer.commands[{i}]") for i in range(4)),
        *((f"m{i + 1}req", I32, f"stabilizer.requested[{i}]") for i in range(4)),
    ],
    "supervisor": [("info", U16, "info")],
    "sys": [
        ("canfly", U8, "supervisor.can_fly"),
        ("isFlying", U8, "supervisor.is_flying"),
        ("isTumbled", U8, "supervisor.is_tumbled"),
        ("armed", I8, "supervisor.is_armed"),
    ],
    "health": [
        *((f"motorVar{axis}M{i}", FLOAT, 0.0) for i in range(1, 5) for axis in "XY"),
        ("motorPass", U8, 0),
        ("batterySag", FLOAT, 0.0),
        ("batteryPass", U8, 0),
        ("motorTestCount", U16, 0),
    ],
    "ring": [("fadeTime", FLOAT, 0.5)],
    "kalman": [
        *((f"state{axis.upper()}", FLOAT, f"estimate.{axis}") for axis in _XYZ),
        *((f"stateP{axis.upper()}", FLOAT, f"estimate.v{axis}") for axis in _XYZ),
        *((f"stateD{i}", FLOAT, 0.0) for i in range(3)),
        *((f"var{axis.upper()}", FLOAT, "estimator.variance_position") for axis in _XYZ),
        *((f"varP{axis.upper()}", FLOAT, "estimator.variance_velocity") for axis in _XYZ),
        *((f"varD{i}", FLOAT, "estimator.variance_attitude") for i in range(3)),
        *_fields(FLOAT, "q0:qw q1:qx q2:qy q3:qz", "estimate"),
        ("rtUpdate", FLOAT, 100.0),
        ("rtPred", FLOAT, 500.0),
        ("rtFinal", FLOAT, 500.0),
    ],
    "locSrv": _fields(FLOAT, "x y z qx qy qz qw", "localization"),
    "locSrvZ": [("tick", U16, "localization.milliseconds")],
    "ext_pos": _fields(FLOAT, "X:x Y:y Z:z", "localization"),
    "controller": [
        ("cmd_thrust", FLOAT, "stabilizer.thrust"),
        ("cmd_roll", FLOAT, "stabilizer.command_roll"),
        ("cmd_pitch", FLOAT, "stabilizer.command_pitch"),
        ("cmd_yaw", FLOAT, "stabilizer.command_yaw*-1"),
        ("r_roll", FLOAT, "sensors.gyro_x*0.017453292519943295"),
        ("r_pitch", FLOAT, "sensors.gyro_y*-0.017453292519943295"),
        ("r_yaw", FLOAT, "sensors.gyro_z*0.017453292519943295"),
        ("accelz", FLOAT, "sensors.acc_z"),
        ("actuatorThrust", FLOAT, "stabilizer.thrust"),
        *_fields(FLOAT, "roll pitch yaw", "stabilizer"),
        *_fields(FLOAT, "rollRate:roll_rate pitchRate:pitch_rate yawRate:yaw_rate", "stabilizer"),
        ("ctr_yaw", I16, "stabilizer.command_yaw*-1"),
    ],
    "pid_attitude": _pid(_ANGLES, "stabilizer.attitude"),
    "pid_rate": _pid(_RATES, "stabilizer.attitude"),
    "posCtl": [
        *((f"targetV{a.upper()}", FLOAT, f"stabilizer.position.v{a}.desired") for a in _XYZ),
        *((f"target{a.upper()}", FLOAT, f"stabilizer.position.{a}.desired") for a in _XYZ),
        *_fields(FLOAT, "bodyVX:body_vx bodyVY:body_vy", "stabilizer.position"),
        *_fields(FLOAT, "bodyX:body_x bodyY:body_y", "stabilizer.position"),
        *(row for a in _XYZ for row in _position_pid(a.upper(), a)),
        *(row for a in _XYZ for row in _position_pid("V" + a.upper(), "v" + a)),
    ],
    "memTst": [("errCntW", U32, "memory_tester.errors")],
    "crtp": [
        ("rxRate", U16, "link_statistics.received_rate"),
        ("txRate", U16, "link_statistics.sent_rate"),
    ],
}
"""Group -> (name, number_type, value)."""
