"""The parameters: names and types of the firmware's, and what they are of.

A parameter is the attribute at the end of a dotted path from the `Firmware`, as
it is a variable in the firmware; or a number, which is kept and given back but
has no effect on the virtual vehicle.
"""

import math
from typing import NamedTuple

from crazyflie_virtual.firmware.stabilizer import DEFAULT, MELLINGER
from crazyflie_virtual.tables.number_types import FLOAT, I8, U8, U16, U32, NumberType
from crazyflie_virtual.tables.toc import pid_paths

#: Those of the firmware's parameters, which stores also what is no number.
NO_LIMITS = (-math.inf, math.inf)


class ParameterSpec(NamedTuple):
    """A parameter."""

    group: str
    name: str
    number_type: NumberType
    source: str | float  #: Path to the attribute, or the first value of one without effect.
    persistent: bool = False  #: Can be stored on the vehicle.
    read_only: bool = False
    #: Least and greatest value; a write of any other is without effect.
    limits: tuple[float, float] = NO_LIMITS


def parameter_specs() -> list[ParameterSpec]:
    """Return all parameters, in the order of their numbers."""
    return [
        ParameterSpec(group, *row) for group, parameters in _GROUPS.items() for row in parameters
    ]


def _rows(number_type, *flags, **sources):
    return [(name, number_type, source, *flags) for name, source in sources.items()]


def _persistent(number_type, **sources):
    return _rows(number_type, True, **sources)


def _read_only(number_type, **sources):
    return _rows(number_type, False, True, **sources)


def _limited(number_type, low, high, **sources):
    return _rows(number_type, False, False, (low, high), **sources)


def _gains(owner, suffixes, **pids):
    gains = dict(zip(suffixes, ("kp", "ki", "kd", "kff"), strict=True))
    return _persistent(FLOAT, **dict(pid_paths(owner, pids, gains)))


_ATTITUDE_GAINS = ("_kp", "_ki", "_kd", "_kff")

_MELLINGER = (
    *("kp_xy", "kd_xy", "ki_xy", "i_range_xy", "kp_z", "kd_z", "ki_z", "i_range_z", "mass"),
    *("kR_xy", "kR_z", "kw_xy", "kw_z", "ki_m_xy", "ki_m_z", "kd_omega_rp"),
    *("i_range_m_xy", "i_range_m_z"),
)

#: Group -> rows, as `ParameterSpec` without the group. The group "virtual" is not the firmware's:
#: its parameters are the fault switches.
_GROUPS = {
    "stabilizer": [
        *_rows(U8, estimator=2),
        # Of the firmware's controllers, those that the virtual vehicle has.
        *_limited(U8, DEFAULT, MELLINGER, controller="stabilizer.controller"),
        *_rows(U8, stop="supervisor.emergency_stop"),
    ],
    "commander": _rows(U8, enHighLevel="commander.high_level_enabled"),
    "hlCommander": [
        *_rows(FLOAT, vtoff="planner.takeoff_speed", vland="planner.landing_speed"),
        *_rows(U8, groupmask="planner.groups"),
    ],
    "supervisor": [
        *_rows(U8, infdmp=0),
        *_persistent(
            U16,
            prefltTimeout="supervisor.preflight_timeout",
            landedTimeout="supervisor.landed_timeout",
        ),
        *_persistent(U8, tmblChckEn="supervisor.tumble_check"),
    ],
    "flightmode": [
        *_rows(U8, althold=0, poshold=0, posSet=0),
        *_persistent(U8, yawMode=2),
        *_rows(U8, yawRst=0),
        *_persistent(
            U8,
            stabModeRoll="attitude_decoder.roll_mode",
            stabModePitch="attitude_decoder.pitch_mode",
            stabModeYaw="attitude_decoder.yaw_mode",
        ),
    ],
    "pid_attitude": [
        *_gains("stabilizer.attitude", _ATTITUDE_GAINS, roll="roll", pitch="pitch", yaw="yaw"),
        *_persistent(FLOAT, yawMaxDelta="stabilizer.attitude.yaw_max_delta"),
        *_persistent(I8, attFiltEn=0),
        *_persistent(FLOAT, attFiltCut=15.0),
    ],
    "pid_rate": [
        *_gains(
            "stabilizer.attitude",
            _ATTITUDE_GAINS,
            roll="roll_rate",
            pitch="pitch_rate",
            yaw="yaw_rate",
        ),
        *_persistent(I8, rateFiltEn=0),
        *_persistent(FLOAT, omxFiltCut=30.0, omyFiltCut=30.0, omzFiltCut=30.0),
    ],
    "posCtlPid": [
        *_gains("stabilizer.position", ("Kp", "Ki", "Kd", "Kff"), x="x", y="y", z="z"),
        *_persistent(
            U16,
            thrustBase="stabilizer.position.thrust_base",
            thrustMin="stabilizer.position.thrust_min",
        ),
        *_persistent(
            FLOAT,
            rLimit="stabilizer.position.roll_limit",
            pLimit="stabilizer.position.pitch_limit",
            xVelMax="stabilizer.position.vx_max",
            yVelMax="stabilizer.position.vy_max",
            zVelMax="stabilizer.position.vz_max",
        ),
    ],
    "velCtlPid": _gains(
        "stabilizer.position", ("Kp", "Ki", "Kd", "KFF"), vx="vx", vy="vy", vz="vz"
    ),
    "ctrlMel": [
        *_persistent(FLOAT, massThrust="stabilizer.mellinger.mass_thrust"),
        *_persistent(FLOAT, **{name: f"stabilizer.mellinger.{name}" for name in _MELLINGER}),
    ],
    "powerDist": _persistent(U32, idleThrust="stabilizer.idle_thrust"),
    "motorPowerSet": [
        *_rows(U8, enable="stabilizer.override.enable"),
        *((f"m{i}", U16, f"stabilizer.override.m{i}") for i in range(1, 5)),
    ],
    "kalman": [
        *_rows(U8, resetEstimation="reset_estimation"),
        *_rows(U8, robustTdoa=0, robustTwr=0),
        *_persistent(
            FLOAT,
            pNAcc_xy=0.5,
            pNAcc_z=1.0,
            pNVel=0.0,
            pNPos=0.0,
            pNAtt=0.0,
            mNBaro=2.0,
            mNGyro_rollpitch=0.1,
            mNGyro_yaw=0.1,
        ),
        *_persistent(
            FLOAT,
            initialX="estimator.initial_x",
            initialY="estimator.initial_y",
            initialZ="estimator.initial_z",
            initialYaw="estimator.initial_yaw",
        ),
        *_rows(FLOAT, maxPos=100.0, maxVel=10.0),
    ],
    "locSrv": [
        *_rows(U8, enRangeStreamFP32=0, enLhAngleStream=0),
        *_rows(FLOAT, extPosStdDev="localization.position_deviation"),
        *_rows(FLOAT, extQuatStdDev="localization.attitude_deviation"),
    ],
    "pm": _persistent(
        FLOAT,
        lowVoltage="power.low_voltage",
        criticalLowVoltage="power.critical_voltage",
    ),
    "health": [
        *_rows(U8, startPropTest=0, startBatTest=0),
        *_persistent(U16, propTestPWMRatio=0, batTestPWMRatio=0),
    ],
    "ring": [
        *_persistent(U8, effect=6),
        *_read_only(U32, neffect=19),
        *_rows(U8, solidRed=20, solidGreen=20, solidBlue=20, headlightEnable=0),
        *_rows(FLOAT, emptyCharge=3.1, fullCharge=4.2),
        *_rows(U32, fadeColor=0),
        *_rows(FLOAT, fadeTime=0.5),
    ],
    "led": _rows(U8, bitmask=0),
    "sound": [
        *_rows(U8, effect=0),
        *_read_only(U32, neffect=14),
        *_rows(U16, freq=4000),
    ],
    "system": [
        *_rows(I8, arm=0),
        *_rows(U8, highlight=0, storageStats=0, storageReformat=0),
        *_rows(U8, taskDump=0, assertInfo=0, testLogParam=0, doAssert=0),
        *_read_only(I8, selftestPassed=1),
    ],
    "firmware": [
        *_read_only(U32, revision0=0x76697274),
        *_read_only(U16, revision1=0x7561),
        *_read_only(U8, modified=0),
    ],
    "cpu": [
        *_read_only(U16, flash=1024),
        *_read_only(U32, id0=0x56495254, id1=0x55414C21, id2=0),
    ],
    "imu_sensors": _read_only(U8, BMP388=1, BMP3XX=1, HMC5883L=0, MS5611=0),
    "imu_tests": _read_only(U8, BMI088=1, MPU6500=0, HMC5883L=0, MS5611=0),
    "deck": [
        *_read_only(
            U8,
            bcFlow2="localization.has_deck",
            bcLighthouse4="localization.has_deck",
            bcZRanger2="ranging.has_flow_deck",
            bcMultiranger="ranging.has_multiranger",
            bcLedRing=1,
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
        *_persistent(U8, front=1, back=3, left=4, right=2),
        *_rows(U8, mode=3, poll=0),
    ],
    "lighthouse": _rows(U8, method=1, systemType=2, bsCalibReset=0),
    "memTst": _rows(U8, resetW="memory_tester.reset_writes"),
    "virtual": [
        *_limited(FLOAT, 0.0, 1.0, loss="faults.loss"),
        *_limited(FLOAT, 0.0, 10.0, delay="faults.delay"),
        *_limited(FLOAT, 0.0, 3600.0, silence="faults.silence"),
        *_limited(U8, 0, 1, lowBattery="faults.low_battery"),
        *_limited(U8, 0, 4, motorFailure="faults.motor_failure"),
    ],
}
