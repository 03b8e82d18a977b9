"""The parameters, with the firmware's names and types, and port 2, which reads and sets them.

A parameter is the attribute at the end of a dotted path from the `Firmware`, as
it is a variable in the firmware; or a number, which is stored and returned but has no effect on the
virtual vehicle.
"""

import errno
import math
import struct
from operator import attrgetter
from typing import NamedTuple

from crazyflie_virtual.crtp import MAX_DATA
from crazyflie_virtual.firmware.estimator import COMPLEMENTARY, KALMAN
from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.firmware.stabilizer import DEFAULT, MELLINGER
from crazyflie_virtual.settings import MOST_STATIONS
from crazyflie_virtual.toc import (
    ATTITUDE_PIDS,
    FLOAT,
    I8,
    PARAMETER_TYPES,
    RATE_PIDS,
    U8,
    U16,
    U32,
    NumberType,
    Table,
    pid_paths,
)

#: Limits of the firmware's parameters, which may also be NaN.
NO_LIMITS = (-math.inf, math.inf)


class ParameterSpec(NamedTuple):
    """A parameter."""

    group: str
    name: str
    number_type: NumberType
    #: Path to the attribute, or the initial value of a parameter without effect.
    source: str | float
    persistent: bool = False  #: Whether it can be stored on the vehicle.
    read_only: bool = False
    #: Smallest and largest value; a write of any other value has no effect.
    limits: tuple[float, float] = NO_LIMITS

    @property
    def full_name(self) -> str:
        """The name with its group."""
        return f"{self.group}.{self.name}"

    @property
    def code(self) -> int:
        """Type and flags in the table."""
        extended = _EXTENDED if self.persistent else 0
        access = _READ_ONLY if self.read_only else _CORE
        return self.number_type.parameter_code | extended | access


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
    return _persistent(FLOAT, **pid_paths(owner, pids, suffixes, ("kp", "ki", "kd", "kff")))


_ATTITUDE_GAINS = ("_kp", "_ki", "_kd", "_kff")

_MELLINGER = (
    *("kp_xy", "kd_xy", "ki_xy", "i_range_xy", "kp_z", "kd_z", "ki_z", "i_range_z", "mass"),
    *("kR_xy", "kR_z", "kw_xy", "kw_z", "ki_m_xy", "ki_m_z", "kd_omega_rp"),
    *("i_range_m_xy", "i_range_m_z"),
)

#: Group -> rows, as `ParameterSpec` without the group. The group "virtual" is not part of the
#: firmware: its parameters are the fault switches.
_GROUPS = {
    "stabilizer": [
        *_limited(U8, COMPLEMENTARY, KALMAN, estimator="estimator.kind"),
        # Those of the firmware's controllers that the virtual vehicle has.
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
            spinupTimeout="supervisor.spinup_timeout",
        ),
        *_persistent(FLOAT, crashDetectGs="supervisor.crash_detect_gs"),
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
        *_gains("stabilizer.attitude", _ATTITUDE_GAINS, **ATTITUDE_PIDS),
        *_persistent(FLOAT, yawMaxDelta="stabilizer.attitude.yaw_max_delta"),
        *_persistent(I8, attFiltEn=0),
        *_persistent(FLOAT, attFiltCut=15.0),
    ],
    "pid_rate": [
        *_gains("stabilizer.attitude", _ATTITUDE_GAINS, **RATE_PIDS),
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
        *_rows(U8, enRangeStreamFP32=0, enLhAngleStream="deck.sends_angles"),
        *_rows(FLOAT, extPosStdDev="localization.position_deviation"),
        *_rows(FLOAT, extQuatStdDev="localization.attitude_deviation"),
    ],
    "pm": _persistent(
        FLOAT,
        lowVoltage="power.low_voltage",
        criticalLowVoltage="power.critical_voltage",
    ),
    "health": [
        *_rows(U8, startPropTest="health.motors_asked", startBatTest="health.battery_asked"),
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
    "colorLedBot": _rows(U32, wrgb8888=0),
    "colorLedTop": _rows(U32, wrgb8888=0),
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
            bcFlow2="deck.has_flow",
            bcLighthouse4="deck.has_lighthouse",
            bcZRanger2="ranging.has_flow_deck",
            bcDWM1000="deck.has_loco",
            bcMultiranger="ranging.has_multiranger",
            bcLedRing="has_led_ring",
            bcColorLedBot="has_color_leds",
            bcColorLedTop="has_color_leds",
            bcActiveMarker=0,
            bcAI=0,
            bcBuzzer=0,
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
        *_limited(U8, 0, 1, deck="faults.deck"),
        *_limited(U8, 0, 4, motorFailure="faults.motor_failure"),
        *_limited(U16, 0, (1 << MOST_STATIONS) - 1, occluded="faults.occluded"),
        *_limited(FLOAT, 0.0, 100.0, smooth="faults.smooth"),
        *_limited(FLOAT, -2.0, 2.0, handX="hand.x", handY="hand.y", handZ="hand.z"),
        *_limited(FLOAT, -180.0, 180.0, handYaw="hand.yaw"),
    ],
}


_TABLE, _READ, _WRITE, _MISC = 0, 1, 2, 3

_SET_BY_NAME, _EXTENDED_TYPE, _STORE, _STATE, _CLEAR = 0, 2, 3, 4, 5
_DEFAULT, _EXTENDED_TYPE_2, _DEFAULT_2 = 6, 7, 8

_WORD = 4  #: Number of bytes of a request after which the answer to a write contains the value.
_PERSISTENT = 1  #: The only extended type.
_EXTENDED, _CORE, _READ_ONLY = 0x10, 0x20, 0x40  #: Flags in the byte of the type's code.

_NO_ENTRY = bytes([errno.ENOENT])


class ParameterPort:
    """Reads and writes parameters, and stores the persistent ones.

    The ``stored`` values, by full name, persist over a restart of the vehicle; they are applied at
    once.
    """

    def __init__(self, firmware: Firmware, stored: dict[str, float]):
        self._firmware = firmware
        self._specs = parameter_specs()
        self._by_name = {spec.full_name: spec for spec in self._specs}
        # Values without effect on the vehicle that were set.
        self._without_effect: dict[str, float] = {}
        #: Initial values, by full name.
        self.defaults = {name: self._value(spec) for name, spec in self._by_name.items()}
        self._stored = stored
        self._warn = firmware.warn
        for name, value in stored.items():
            self._assign(self._by_name[name], value)
        self.table = Table([(spec.group, spec.name, spec.code) for spec in self._specs])

    def handle(self, channel: int, data: bytes) -> bytes | None:
        """Return the data of the answer; None for no answer."""
        if channel == _TABLE:
            return self.table.answer(data)
        if channel == _MISC:
            return self._misc(data)
        if len(data) < 2:
            return None
        return self._read(data) if channel == _READ else self._write(data)

    def _find(self, data, at=0):
        (index,) = struct.unpack_from("<H", data, at)
        return self._specs[index] if index < len(self._specs) else None

    def _value(self, spec):
        if isinstance(spec.source, str):
            return attrgetter(spec.source)(self._firmware)
        return self._without_effect.get(spec.full_name, spec.source)

    def _assign(self, spec, value):
        if isinstance(spec.source, str):
            path, _, attribute = f"_firmware.{spec.source}".rpartition(".")
            setattr(attrgetter(path)(self), attribute, value)
        else:
            self._without_effect[spec.full_name] = value

    def _read(self, data):
        spec = self._find(data)
        if spec is None:
            return data[:2] + _NO_ENTRY
        return data[:2] + b"\0" + spec.number_type.pack(self._value(spec))

    def _write(self, data):
        spec = self._find(data)
        if spec is None:
            self._warn("parameter", f"PARAM: no parameter has the number {data[:2].hex()}")
            return data[:2] + _NO_ENTRY
        if spec.read_only:
            self._warn(spec.full_name, f"PARAM: {spec.full_name} is read-only")
            return None
        self._set(spec, data[2:])
        # The answer is as long as the request, whatever the value's size.
        value = spec.number_type.pack(self._value(spec)).ljust(_WORD, b"\0")
        return data[:2] + (value[: len(data) - 2] + data[2 + len(value) :])

    def _set(self, spec, data):
        name, number_type, (low, high) = spec.full_name, spec.number_type, spec.limits
        value = number_type.unpack(data[: number_type.size].ljust(number_type.size, b"\0"))
        if not isinstance(spec.source, str) and value != self._value(spec):
            self._warn(name, f"PARAM: {name} is stored, but has no effect on a virtual vehicle")
        if low <= value <= high or spec.limits == NO_LIMITS:
            self._assign(spec, value)
        else:
            self._warn(name, f"PARAM: {name} is {low:g} to {high:g}, not {value:g}")

    def _misc(self, data):
        if not data:
            return None
        command = data[0]
        if command == _SET_BY_NAME:
            return self._set_by_name(data)
        if not _EXTENDED_TYPE <= command <= _DEFAULT_2 or len(data) < 3:
            self._warn("parameter command", f"PARAM: unknown command {data.hex()}")
            return None
        spec = self._find(data, 1)
        answer = None if spec is None else self._answer(command, spec)
        if answer is None:
            return data[:3] + _NO_ENTRY
        # Only the newer commands tell success.
        return data[:3] + (b"\0" if command in (_EXTENDED_TYPE_2, _DEFAULT_2) else b"") + answer

    def _set_by_name(self, data):
        parts = data[1:].split(b"\0", 2)
        if len(parts) < 3 or not parts[2]:
            return None
        spec = self._by_name.get(b".".join(parts[:2]).decode("latin1"))
        error = 0
        if spec is None:
            error = errno.ENOENT
        elif PARAMETER_TYPES.get(parts[2][0]) is not spec.number_type:
            error = errno.EINVAL
        elif spec.read_only:
            error = errno.EACCES
        else:
            self._set(spec, parts[2][1:])
        names = data[: 1 + len(parts[0]) + 1 + len(parts[1]) + 1]
        return (names + bytes([error]))[:MAX_DATA]

    def _answer(self, command, spec):
        # Answer to another command; None if the parameter does not have the requested property.
        name, pack = spec.full_name, spec.number_type.pack
        if command in (_EXTENDED_TYPE, _EXTENDED_TYPE_2) and spec.persistent:
            return bytes([_PERSISTENT])
        if command in (_DEFAULT, _DEFAULT_2) and not spec.read_only:
            return pack(self.defaults[name])
        if command == _STATE:
            is_stored = name in self._stored
            stored = pack(self._stored[name]) if is_stored else b""
            return bytes([is_stored]) + pack(self.defaults[name]) + stored
        if command == _STORE and spec.persistent:
            self._stored[name] = self._value(spec)
            return b"\0"
        if command == _CLEAR and self._stored.pop(name, None) is not None:
            return b"\0"
        return None
