"""Positioning decks: their measurements of the true pose, and their failures.

Figures are of the order that Bitcraze's documentation and users report; they are not those of a
device.
"""

import math
import random
import struct
from dataclasses import dataclass
from functools import lru_cache
from types import SimpleNamespace

import numpy as np

from crazyflie_model.angles import Quaternion, Triple, product, rotate
from crazyflie_virtual.body import Physics
from crazyflie_virtual.firmware.estimator import Estimator
from crazyflie_virtual.memory import LighthouseMemory
from crazyflie_virtual.settings import DECK, FLOW, LIGHTHOUSE, LOCO, MOST_STATIONS, VehicleSettings

_POSITION_DEVIATION = 0.003  #: Deviation of the deck that knows the true pose (m).
_ATTITUDE_DEVIATION = 0.003  #: Deviation of all decks (rad).

#: Deviations of a position by Lighthouse with one and with more base stations, m: one knows the
#: distance only from the angle between the deck's sensors, which are 3 cm apart.
_LIGHTHOUSE_DEVIATIONS = (0.006, 0.0015)
_LOCO_DEVIATION = 0.03  #: Deviation of a position by Loco with ultra-wideband ranging, m.

#: Drift of a position by optical flow, per square root of the distance flown (m).
_DRIFT = 0.015

#: Process noise of a velocity that is not measured, m^2/s^3: 0.5 m/s after 1 s.
_UNMEASURED = 0.25

#: Places of the base stations (m), which look at the middle of the floor; one for each that
#: `VehicleSettings.base_stations` allows.
_STATIONS = (
    (-2.0, 1.5, 2.2),
    (2.0, 1.0, 2.4),
    # The others on a circle.
    *(
        (2.5 * math.cos(angle), 2.5 * math.sin(angle), 2.3)
        for angle in (k * math.tau / (MOST_STATIONS - 2) for k in range(MOST_STATIONS - 2))
    ),
)

#: Places of the Lighthouse deck's four sensors on the vehicle (m).
_SENSORS = tuple((x, y, 0.0) for x in (-0.015, 0.015) for y in (0.0075, -0.0075))

_ANGLE_DEVIATION = 1e-4  #: Deviation of an angle that a sensor measures (rad).
_ANGLE_PERIOD = 2  #: Number of calls of `PositioningDeck.measure` per set of angles.
_ANGLES = 10  #: Type of the packet that contains the angles.
_GEOMETRY, _CALIBRATION = struct.Struct("<12f?"), struct.Struct("<14fI?")


def _rows(x: float, y: float, z: float) -> list[Triple]:
    # Rotation matrix, by rows, of a base station that looks at the origin: its x axis is forward.
    yaw, pitch = math.atan2(-y, -x), math.atan2(z, math.hypot(x, y))
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    return [(cy * cp, -sy, cy * sp), (sy * cp, cy, sy * sp), (-sp, 0.0, cp)]


_ROTATIONS = [_rows(*place) for place in _STATIONS]
#: True geometries as the vehicle's memory has them: place, rotation matrix, valid.
GEOMETRIES = [
    _GEOMETRY.pack(*place, *(each for row in rows for each in row), True)
    for place, rows in zip(_STATIONS, _ROTATIONS, strict=True)
]


def lighthouse_pages(settings: VehicleSettings) -> dict[int, bytes]:
    """Return the initial pages of the memory of base stations, by number.

    A base station transmits its calibration; its geometry is from an earlier estimate.
    """
    if settings.positioning != LIGHTHOUSE:
        return {}
    numbers = range(settings.base_stations)
    geometries = {number: GEOMETRIES[number] for number in numbers}
    first = LighthouseMemory.CALIBRATION_PAGE
    calibrations = {n + first: _CALIBRATION.pack(*[0.0] * 14, 1 + n, True) for n in numbers}
    return calibrations | (geometries if settings.knows_stations else {})


@lru_cache(maxsize=64)
def _frame(station: int, page: bytes) -> tuple[Quaternion, Triple] | None:
    # Attitude and origin of the world in the frame of a stored geometry; None if it is not valid.
    values, true = _GEOMETRY.unpack(page), _GEOMETRY.unpack(GEOMETRIES[station])
    rotation = np.reshape(values[3:12], (3, 3)) @ np.reshape(true[3:12], (3, 3)).T
    if not values[-1] or abs(np.linalg.det(rotation) - 1.0) > 0.01:
        return None
    x, y, z = map(float, np.array(values[:3]) - rotation @ true[:3])
    return _quaternion(rotation), (x, y, z)


def _quaternion(rotation):
    # Of a rotation matrix. Source: I. Y. Bar-Itzhack, New method for extracting the quaternion from
    # a rotation matrix, Journal of Guidance, Control, and Dynamics 23 (2000).
    (a, b, c), (d, e, f), (g, h, i) = rotation
    matrix = [
        [a - e - i, b + d, c + g, h - f],
        [b + d, e - a - i, f + h, c - g],
        [c + g, f + h, i - a - e, d - b],
        [h - f, c - g, d - b, a + e + i],
    ]
    # The eigenvector of the largest eigenvalue.
    x, y, z, w = map(float, np.linalg.eigh(matrix)[1][:, 3])
    return x, y, z, w


@dataclass(eq=False)
class PositioningDeck:
    """Corrects an estimator by measurements of the decks that a vehicle carries."""

    settings: VehicleSettings
    faults: SimpleNamespace
    estimator: Estimator
    physics: Physics
    #: Variance that is added to the estimator's own for the horizontal velocity, m^2/s^2: that of
    #: a velocity which is not measured at present.
    unmeasured: float = 0.0
    received: int = 0  #: Bit mask of the base stations whose light the deck has received last.
    sends_angles: int = 0  #: If not 0, the measured angles are sent to the client.

    def __post_init__(self) -> None:
        kind = self.settings.positioning
        self.has_flow = kind in (DECK, FLOW)
        self.has_lighthouse = kind in (DECK, LIGHTHOUSE)
        self.has_loco = kind == LOCO
        self._stations = (1 << self.settings.base_stations) - 1
        self._random = random.Random(self.settings.seed)
        #: Difference of the position by optical flow from the true one, m.
        self._drift = [0.0, 0.0]
        self._is_drift_known = False
        #: Geometry and calibration of the base stations.
        self.memory = LighthouseMemory({})
        self._angles: list[bytes] = []
        self._angle_phase = 0

    @property
    def is_there(self) -> bool:
        """Whether the vehicle carries any of the decks."""
        return self.has_flow or self.has_lighthouse or self.has_loco

    @property
    def located_stations(self) -> int:
        """Bit mask of the base stations of which the vehicle has a valid geometry."""
        pages = map(self.memory.page, range(self.memory.stations))
        return sum(1 << i for i, page in enumerate(pages) if _frame(i, page) is not None)

    @property
    def calibrated_stations(self) -> int:
        """Bit mask of the base stations of which the vehicle has a valid calibration."""
        first = LighthouseMemory.CALIBRATION_PAGE
        pages = (self.memory.page(first + i) for i in range(self.memory.stations))
        return sum(1 << i for i, page in enumerate(pages) if page[-1])

    @property
    def active_stations(self) -> int:
        """Bit mask of the base stations that contribute to the position."""
        return self.received & self.located_stations & self.calibrated_stations

    def take_angles(self) -> list[bytes]:
        """Return the packets with measured angles since the last call."""
        angles, self._angles = self._angles, []
        return angles

    def forget_drift(self) -> None:
        """Restart the measurement by optical flow at the present estimate, which has been set."""
        self._is_drift_known = False

    def measure(self, dt: float) -> None:
        """Correct the estimate by the measurements of ``dt`` s."""
        kind = self.settings.positioning
        if kind == FLOW:
            self._measure_flow(dt)
        elif kind == LIGHTHOUSE:
            self._measure_lighthouse()
        else:
            deviation = _LOCO_DEVIATION if kind == LOCO else 0.0
            quaternion = self.physics.quaternion
            self._correct(self._noisy(deviation), deviation or _POSITION_DEVIATION, quaternion)

    def _measure_lighthouse(self):
        self.received = self._stations & ~self.faults.occluded
        self._angle_phase = (self._angle_phase + 1) % _ANGLE_PERIOD
        if self.sends_angles and not self._angle_phase:
            self._angles += map(self._measured_angles, _numbers(self.received))
        active = _numbers(self.active_stations)
        if not active:
            return
        deviation = _LIGHTHOUSE_DEVIATIONS[min(len(active), 2) - 1]
        position = self._noisy(deviation)
        # Where the estimate of a base station's place is wrong, so is that of the vehicle.
        frames = [frame for i in active if (frame := _frame(i, self.memory.page(i)))]
        places = [
            [a + b for a, b in zip(rotate(attitude, position), origin, strict=True)]
            for attitude, origin in frames
        ]
        x, y, z = (sum(parts) / len(frames) for parts in zip(*places, strict=True))
        self._correct((x, y, z), deviation, product(frames[0][0], self.physics.quaternion))

    def _measured_angles(self, station):
        # A packet with the horizontal and the vertical angle of each sensor (rad), those of the
        # second to the fourth as differences from the first in half precision.
        arms = np.array([rotate(self.physics.quaternion, sensor) for sensor in _SENSORS])
        ways = arms + self.physics.position - _STATIONS[station]
        x, y, z = (ways @ _ROTATIONS[station]).T
        fields = []
        for angles in np.arctan2((y, z), x):
            noise = [self._random.gauss(0.0, _ANGLE_DEVIATION) for _ in _SENSORS]
            first, *others = angles + noise
            fields += [first, *(first - other for other in others)]
        return struct.pack("<BBf3ef3e", _ANGLES, station, *fields)

    def _noisy(self, deviation: float) -> Triple:
        x, y, z = (part + self._random.gauss(0.0, deviation) for part in self.physics.position)
        return x, y, z

    def _measure_flow(self, dt):
        e, (x, y, z) = self.estimator.estimate, self.physics.position
        s = self.settings
        has_texture = math.hypot(x - s.smooth_x, y - s.smooth_y) >= self.faults.smooth
        if not (has_texture and self._is_drift_known):
            # Only the motion from here on is measured, not the position of this point.
            self._drift = [e.x - x, e.y - y]
            self._is_drift_known = True
        if has_texture:
            way = math.hypot(*self.physics.velocity[:2]) * dt
            step = _DRIFT * math.sqrt(way)
            self._drift = [part + self._random.gauss(0.0, step) for part in self._drift]
            self.unmeasured = 0.0
        else:
            self.unmeasured += _UNMEASURED * dt
        position = (x + self._drift[0], y + self._drift[1], z)
        self._correct(position, _POSITION_DEVIATION, self.physics.quaternion)

    def _correct(self, position: Triple, deviation: float, quaternion: Quaternion) -> None:
        self.estimator.correct_position(*position, deviation)
        self.estimator.correct_attitude(*quaternion, _ATTITUDE_DEVIATION)


def _numbers(mask):
    return [number for number in range(mask.bit_length()) if mask >> number & 1]
