"""External positions and attitudes.

The client sends external positions or poses, as real vehicles get them from a
motion capture system. In their absence a positioning deck measures the true
pose; without a deck the estimate is dead reckoning.
"""

from crazyflie_model.angles import Quaternion, Triple
from crazyflie_virtual.body.physics import Physics
from crazyflie_virtual.firmware.estimator import Estimator

DECK, NONE = "deck", "none"  #: Positioning systems.
EXTERNAL_AGE = 0.5  #: The deck measures only when there was no external measurement for so long, s.
_DECK_POSITION_DEVIATION = 0.003  #: m.
_DECK_ATTITUDE_DEVIATION = 0.003  #: rad.


class Localization:
    """Corrects the estimator by external measurements, and by those of a positioning deck."""

    def __init__(self, estimator: Estimator, physics: Physics, has_deck: bool):
        self._estimator = estimator
        self._physics = physics
        self.has_deck = has_deck
        #: x, y, z, qx, qy, qz, qw: Last external measurement, m; for the log.
        self.x = self.y = self.z = 0.0
        self.qx = self.qy = self.qz = 0.0
        self.qw = 1.0
        self.time: float | None = None  #: When it came, s.
        #: position_deviation, attitude_deviation: Standard deviations that external measurements
        #: are taken to have, m and rad.
        self.position_deviation = 0.01
        self.attitude_deviation = 0.0045

    @property
    def milliseconds(self) -> float:
        """When the last external measurement came, ms, in the 16 bits of the log."""
        return 0.0 if self.time is None else 1000.0 * self.time % 65536.0

    def take_position(self, time: float, position: Triple) -> None:
        """Process an external position (m)."""
        self.time = time
        self.x, self.y, self.z = position
        self._estimator.correct_position(*position, self.position_deviation)

    def take_pose(self, time: float, position: Triple, quaternion: Quaternion) -> None:
        """Process an external position (m) and attitude, a unit quaternion (x, y, z, w)."""
        self.take_position(time, position)
        self.qx, self.qy, self.qz, self.qw = quaternion
        self._estimator.correct_attitude(*quaternion, self.attitude_deviation)

    def update(self, time: float) -> None:
        """Measure with the deck, if there is one and no external measurement."""
        is_external = self.time is not None and time - self.time < EXTERNAL_AGE
        if self.has_deck and not is_external:
            self._estimator.correct_position(*self._physics.position, _DECK_POSITION_DEVIATION)
            self._estimator.correct_attitude(*self._physics.quaternion, _DECK_ATTITUDE_DEVIATION)
