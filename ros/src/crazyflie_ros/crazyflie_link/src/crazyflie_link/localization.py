"""Poses measured by an external system, such as motion capture."""

import math
from collections.abc import Sequence

from crazyflie_link.checks import check_finite
from crazyflie_link.errors import ValueRangeError
from crazyflie_link.subsystem import Subsystem

_STREAM = "localization"


class Localization(Subsystem):
    """Measured poses for the vehicle's estimator; nothing here blocks."""

    def position(self, x: float, y: float, z: float) -> None:
        """Send a position in the world, m."""
        check_finite("external position", x, y, z)
        link = self._current_link()
        link.put_latest(_STREAM, lambda: link.cflib.loc.send_extpos((x, y, z)))

    def pose(self, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """Send a position (m) and an attitude (x, y, z, w) in the world.

        The quaternion is normalised.
        """
        check_finite("external pose", *position, *quaternion)
        norm = math.hypot(*quaternion)
        if norm < 1e-6:
            raise ValueRangeError("external pose: the quaternion (0, 0, 0, 0) is no attitude")
        unit = [component / norm for component in quaternion]
        link = self._current_link()
        link.put_latest(_STREAM, lambda: link.cflib.loc.send_extpose(position, unit))
