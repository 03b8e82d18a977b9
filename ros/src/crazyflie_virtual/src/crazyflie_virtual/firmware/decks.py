"""Positioning decks: what they measure of the true pose, and where they fail.

Figures are of the order that Bitcraze's documentation and users report; they are not those of a
device.
"""

import math
import random
from dataclasses import dataclass

from crazyflie_model.angles import Triple
from crazyflie_virtual.body import Physics
from crazyflie_virtual.firmware.estimator import Estimator
from crazyflie_virtual.settings import DECK, FLOW, LIGHTHOUSE, LOCO, FaultSwitches, VehicleSettings

_POSITION_DEVIATION = 0.003  #: Deviation of the deck that knows the true pose (m).
_ATTITUDE_DEVIATION = 0.003  #: Deviation of all decks (rad).

#: Deviations of a position by Lighthouse with one and with two base stations, m: one knows the
#: distance only from the angle between the deck's sensors, which are 3 cm apart.
_LIGHTHOUSE_DEVIATIONS = (0.006, 0.0015)
_LOCO_DEVIATION = 0.03  #: Deviation of a position by Loco with ultra-wideband ranging, m.

#: A position by optical flow departs from the true one by this much per square root of the way, m.
_DRIFT = 0.015

#: Process noise of a velocity that is not measured, m^2/s^3: 0.5 m/s after 1 s.
_UNMEASURED = 0.25


@dataclass(eq=False)
class PositioningDeck:
    """Corrects an estimator by measurements of the decks that a vehicle carries."""

    settings: VehicleSettings
    faults: FaultSwitches
    estimator: Estimator
    physics: Physics
    #: Variance that is added to the estimator's own for the horizontal velocity, m^2/s^2: that of
    #: a velocity which is not measured at present.
    unmeasured: float = 0.0
    received: int = 0  #: Bit mask of the base stations whose light the deck has received last.

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

    @property
    def is_there(self) -> bool:
        """Whether the vehicle carries any of the decks."""
        return self.has_flow or self.has_lighthouse or self.has_loco

    @property
    def known_stations(self) -> int:
        """Bit mask of the base stations of which the vehicle has geometry and calibration."""
        has_light = self.settings.positioning == LIGHTHOUSE
        return self._stations if has_light and self.settings.knows_stations else 0

    @property
    def active_stations(self) -> int:
        """Bit mask of the base stations that contribute to the position."""
        return self.received & self.known_stations

    def measure(self, dt: float) -> None:
        """Correct the estimate by the measurements of ``dt`` s."""
        kind = self.settings.positioning
        if kind == FLOW:
            self._measure_flow(dt)
            return
        if kind == LIGHTHOUSE:
            self.received = self._stations & ~self.faults.occluded
            number = self.active_stations.bit_count()
            if not number:
                return
            deviation = _LIGHTHOUSE_DEVIATIONS[number - 1]
        else:
            deviation = _LOCO_DEVIATION if kind == LOCO else 0.0
        self._correct(self._noisy(deviation), deviation or _POSITION_DEVIATION)

    def _noisy(self, deviation: float) -> Triple:
        x, y, z = self.physics.position
        if not deviation:
            return x, y, z
        noise = self._random.gauss
        return x + noise(0.0, deviation), y + noise(0.0, deviation), z + noise(0.0, deviation)

    def _measure_flow(self, dt):
        e, (x, y, z) = self.estimator.estimate, self.physics.position
        has_texture = self._has_texture(x, y)
        if not (has_texture and self._is_drift_known):
            # What is flown on from here is measured, and not where here is.
            self._drift = [e.x - x, e.y - y]
            self._is_drift_known = True
        if has_texture:
            way = math.hypot(*self.physics.velocity[:2]) * dt
            step = _DRIFT * math.sqrt(way)
            self._drift = [part + self._random.gauss(0.0, step) for part in self._drift]
            self.unmeasured = 0.0
        else:
            self.unmeasured += _UNMEASURED * dt
        self._correct((x + self._drift[0], y + self._drift[1], z), _POSITION_DEVIATION)

    def _has_texture(self, x, y):
        s = self.settings
        return math.hypot(x - s.smooth_x, y - s.smooth_y) >= self.faults.smooth

    def _correct(self, position: Triple, deviation: float) -> None:
        self.estimator.correct_position(*position, deviation)
        self.estimator.correct_attitude(*self.physics.quaternion, _ATTITUDE_DEVIATION)
