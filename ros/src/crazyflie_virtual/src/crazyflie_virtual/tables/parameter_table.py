"""The parameters: names and types of the firmware's, and what they are of.

A parameter is the attribute at the end of a dotted path from the `Firmware`, as
it is a variable in the firmware; or a number, which is kept and given back but
has no effect on the virtual vehicle.
"""

import math
from typing import NamedTuple

from crazyflie_virtual.tables.number_types import FLOAT, I8, U8, U16, U32, NumberType

NO_LIMITS = (-math.inf, math.inf)
"""Those of the firmware's parameters, which stores also what is no number."""


class ParameterSpec(NamedTuple):
    """A parameter.

    Attributes
    ----------
    group, name : str
    number_type : NumberType
    source : str or float
        Path to the attribute, or the first value of one without effect.
    persistent : bool
        Can be stored on the vehicle.
    read_only : bool
    limits : tuple of float
        Least and greatest value; a write of any other is without effect.
    """

    group: str
    name: str
    number_type: NumberType
    source: str | float
    persistent: bool = False
    read_only: bool = False
    limits: tuple[float, float] = NO_LIMITS


def parameter_specs() -> list[ParameterSpec]:
    """Return all parameters, in the order of their numbers."""
    return [
        ParameterSpec(group, *row) for group, parameters in _GROUPS.items() for row in parameters
    ]


_KEPT, _PERSISTENT = False, True


def _rows(number_type, persistent, **sources):
    return [(name, number_type, source, persistent) for name, source in sources.items()]


def _constants(number_type, **values):
    return [(name, number_type, value, False, True) for name, value in values.items()]


def _pid(names, path, form):
    # Gains of PID controllers under the firmware's names.
    return [
        (form.format(prefix, gain), FLOAT, f"{path}.{field}.{gain}", _PERSISTENT)
        for prefix, field in names
        for gain in ("kp", "ki", "kd", "kff")
    ]


def _position_pid(names):
    gains = (("Kp", "kp"), ("Ki", "ki"), ("Kd", "kd"), ("Kff", "kff"))
    return [
        (prefix + shown, FLOAT, f"stabilizer.position.{field}.{gain}", _PERSISTENT)
        for prefix, field in names
        for shown, gain in gains
    ]


_ANGLES = (("roll", "roll"), ("pitch", "pitch"), ("yaw", "yaw"))
_RATES = (("roll", "roll_rate"), ("pitch", "pitch_rate"), ("yaw", "yaw_rate"))

_GROUPS = {
    "stabilizer": [
        *_rows(U8, _KEPT, estimator=2, controller=1),
        ("stop", U8, "supervisor.emergency_stop"),
    ],
    "commander": [("enHighLevel", U8, "commander.high_level_enabled")],
    "hlCommander": [
        *_rows(FLOAT, _KEPT, vtoff="planner.takeoff_speed", vland="planner.landing_speed"),
        ("groupmask", U8, "planner.groups"),
    ],
    "supervisor": [
        ("infdmp", U8, 0),
        ("prefltTimeout", U16, "supervisor.preflight_timeout", _PERSISTENT),
        ("landedTimeout", U16, "supervisor.landed_timeout", _PERSISTENT),
        ("tmblChckEn", U8, "supervisor.tumble_check", _PERSISTENT),
    ],
    "flightmode": [
        *_rows(U8, _KEPT, althold=0, poshold=0, posSet=0),
        *_rows(U8, _PERSISTENT, yawMode=2),
        *_rows(U8, _KEPT, yawRst=0),
        *_rows(
            U8,
            _PERSISTENT,
            stabModeRoll="attitude_decoder.roll_mode",
            stabModePitch="attitude_decoder.pitch_mode",
            stabModeYaw="attitude_decoder.yaw_mode",
        ),
    ],
    "pid_attitude": [
        *_pid(_ANGLES, "stabilizer.attitude", "{}_{}"),
        ("yawMaxDelta", FLOAT, "stabilizer.attitude.yaw_max_delta", _PERSISTENT),
        *_rows(I8, _PERSISTENT, attFiltEn=0),
        *_rows(FLOAT, _PERSISTENT, attFiltCut=15.0),
    ],
    "pid_rate": [
        *_pid(_RATES, "stabilizer.attitude", "{}_{}"),
        *_rows(I8, _PERSISTENT, rateFiltEn=0),
        *_rows(FLOAT, _PERSISTENT, omxFiltCut=30.0, omyFiltCut=30.0, omzFiltCut=30.0),
    ],
    "posCtlPid": [
        *_position_pid((("x", "x"), ("y", "y"), ("z", "z"))),
        *_rows(
            U16,
            _PERSISTENT,
            thrustBase="stabilizer.position.thrust_base",
            thrustMin="stabilizer.position.thrust_min",
        ),
        *_rows(
            FLOAT,
            _PERSISTENT,
            rLimit="stabilizer.position.roll_limit",
            pLimit="stabilizer.position.pitch_limit",
            xVelMax="stabilizer.position.vx_max",
            yVelMax="stabilizer.position.vy_max",
            zVelMax="stabilizer.position.vz_max",
        ),
    ],
    "velCtlPid": [
        (prefix + shown, FLOAT, f"stabilizer.position.{prefix}.{gain}", _PERSISTENT)
        for prefix in ("vx", "vy", "vz")
        for shown, gain in (("Kp", "kp"), ("Ki", "ki"), ("Kd", "kd"), ("KFF", "kff"))
    ],
    "powerDist": [("idleThrust", U32, "stabilizer.idle_thrust", _PERSISTENT)],
    "motorPowerSet": [
        ("enable", U8, "stabilizer.override.enable"),
        *((f"m{i}", U16, f"stabilizer.override.m{i}") for i in range(1, 5)),
    ],
    "kalman": [
        ("resetEstimation", U8, "reset_estimation"),
        *_rows(U8, _KEPT, robustTdoa=0, robustTwr=0),
        *_rows(
            FLOAT,
            _PERSISTENT,
            pNAcc_xy=0.5,
            pNAcc_z=1.0,
            pNVel=0.0,
            pNPos=0.0,
            pNAtt=0.0,
            mNBaro=2.0,
            mNGyro_rollpitch=0.1,
            mNGyro_yaw=0.1,
        ),
        *_rows(
            FLOAT,
            _PERSISTENT,
            initialX="estimator.initial_x",
            initialY="estimator.initial_y",
            initialZ="estimator.initial_z",
            initialYaw="estimator.initial_yaw",
        ),
        *_rows(FLOAT, _KEPT, maxPos=100.0, maxVel=10.0),
    ],
    "locSrv": [
        *_rows(U8, _KEPT, enRangeStreamFP32=0, enLhAngleStream=0),
        ("extPosStdDev", FLOAT, "localization.position_deviation"),
        ("extQuatStdDev", FLOAT, "localization.attitude_deviation"),
    ],
    "pm": _rows(
        FLOAT,
        _PERSISTENT,
        lowVoltage="power.low_voltage",
        criticalLowVoltage="power.critical_voltage",
    ),
    "health": [
        *_rows(U8, _KEPT, startPropTest=0, startBatTest=0),
        *_rows(U16, _PERSISTENT, propTestPWMRatio=0, batTestPWMRatio=0),
    ],
    "ring": [
        ("effect", U8, 6, _PERSISTENT),
        *_constants(U32, neffect=19),
        *_rows(U8, _KEPT, solidRed=20, solidGreen=20, solidBlue=20, headlightEnable=0),
        *_rows(FLOAT, _KEPT, emptyCharge=3.1, fullCharge=4.2),
        *_rows(U32, _KEPT, fadeColor=0),
        *_rows(FLOAT, _KEPT, fadeTime=0.5),
    ],
    "led": _rows(U8, _KEPT, bitmask=0),
    "sound": [
        *_rows(U8, _KEPT, effect=0),
        *_constants(U32, neffect=14),
        *_rows(U16, _KEPT, freq=4000),
    ],
    "system": [
        *_rows(I8, _KEPT, arm=0),
        *_rows(U8, _KEPT, highlight=0, storageStats=0, storageReformat=0),
        *_rows(U8, _KEPT, taskDump=0, assertInfo=0, testLogParam=0, doAssert=0),
        *_constants(I8, selftestPassed=1),
    ],
    "firmware": [
        *_constants(U32, revision0=0x76697274),
        *_constants(U16, revision1=0x7561),
        *_constants(U8, modified=0),
    ],
    "cpu": [
        *_constants(U16, flash=1024),
        *_constants(U32, id0=0x56495254, id1=0x55414C21, id2=0),
    ],
    "imu_sensors": _constants(U8, BMP388=1, BMP3XX=1, HMC5883L=0, MS5611=0),
    "imu_tests": _constants(U8, BMI088=1, MPU6500=0, HMC5883L=0, MS5611=0),
    "deck": [
        ("bcFlow2", U8, "localization.has_deck", False, True),
        ("bcLighthouse4", U8, "localization.has_deck", False, True),
        ("bcZRanger2", U8, "ranging.has_flow_deck", False, True),
        ("bcMultiranger", U8, "ranging.has_multiranger", False, True),
        *_constants(U8, bcLedRing=1),
        *_constants(
            U8,
            bcActiveMarker=0,
            bcAI=0,
            bcBuzzer=0,
            bcDWM1000=0,
            bcFlow=0,
            bcLoco=0,
            bcUSD=0,
            bcZRanger=0,
        ),
    ],
    "activeMarker": [
        *_rows(U8, _PERSISTENT, front=1, back=3, left=4, right=2),
        *_rows(U8, _KEPT, mode=3, poll=0),
    ],
    "lighthouse": _rows(U8, _KEPT, method=1, systemType=2, bsCalibReset=0),
    "memTst": [("resetW", U8, "memory_tester.reset_writes")],
    "virtual": [
        ("loss", FLOAT, "faults.loss", _KEPT, False, (0.0, 1.0)),
        ("delay", FLOAT, "faults.delay", _KEPT, False, (0.0, 10.0)),
        ("silence", FLOAT, "faults.silence", _KEPT, False, (0.0, 3600.0)),
        ("lowBattery", U8, "faults.low_battery", _KEPT, False, (0, 1)),
        ("motorFailure", U8, "faults.motor_failure", _KEPT, False, (0, 4)),
    ],
}
"""Group -> (name, type, source, persistent, read only). The group "virtual" is not the
firmware's: its parameters are the fault switches."""
