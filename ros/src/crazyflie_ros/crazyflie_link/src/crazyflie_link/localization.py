"""Poses measured by an external system, such as motion capture."""

import math
from collections.abc import Callable, Sequence

from crazyflie_link.checks import check_finite
from crazyflie_link.errors import ValueRangeError
from crazyflie_link.link import Link
from crazyflie_link.packed_poses import MAX_POSITION, PackedPoses
from crazyflie_link.subsystem import Subsystem

_STREAM = "localization"


class Localization(Subsystem):
    """Measured poses for the vehicle's estimator; nothing here blocks."""

    def __init__(self, current_link: Callable[[], Link]):
        super().__init__(current_link)
        self._packed: tuple[PackedPoses, int] | None = None

    def broadcast_by(self, packed: PackedPoses | None, vehicle_id: int = 0) -> None:
        """Send poses together with those of other vehicles; None for by itself again."""
        self._packed = None if packed is None else (packed, vehicle_id)

    def position(self, x: float, y: float, z: float) -> None:
        """Send a position in the world, m."""
        check_finite("external position", x, y, z)
        link = self._current_link()
        if not self._pack((x, y, z), None):
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
        if not self._pack(position, unit):
            link.put_latest(_STREAM, lambda: link.cflib.loc.send_extpose(position, unit))

    def _pack(self, position, quaternion):
        if self._packed is None or max(map(abs, position)) > MAX_POSITION:
            return False
        packed, vehicle_id = self._packed
        packed.put(vehicle_id, (position, quaternion))
        return True
