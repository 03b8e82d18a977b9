"""A velocity that follows an object, from the distance to it."""

from collections.abc import Iterator

from typing_extensions import override

from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import Number

_DISTANCE = Number("m", above=0.0)


class Follower(Parameters):
    """Follows what is in front: at full speed ahead or back, or not at all.

    Nearer than ``back_off`` it backs off; beyond ``follow``, up to ``lost``, it follows; else it
    stands still. What is not in front, but up to ``lost`` away at one side only, it turns to.
    """

    scale_linear: float = parameter(
        Number("m/s", minimum=0.0), "speed ahead and back", 0.3, live=True
    )
    scale_angular: float = parameter(
        Number("rad/s", minimum=0.0),
        "yaw rate to what is at one side and not in front; 0: no turning",
        0.0,
        live=True,
    )
    back_off: float = parameter(
        _DISTANCE, "backs off from what is nearer", 0.3, "distances/back_off", live=True
    )
    follow: float = parameter(
        _DISTANCE, "follows what is farther away", 0.6, "distances/follow", live=True
    )
    lost: float = parameter(
        _DISTANCE, "but not what is beyond this", 2.0, "distances/lost", live=True
    )

    @override
    def complaints(self) -> Iterator[str]:
        if not self.back_off <= self.follow <= self.lost:
            yield (
                f"distances/back_off, follow and lost are {self.back_off:g}, {self.follow:g} and "
                f"{self.lost:g}; expected each >= the one before (m)"
            )

    def velocity(
        self, front: float, left: float | None = None, right: float | None = None
    ) -> tuple[float, float]:
        """Return the velocity ahead (m/s) and the yaw rate (rad/s, counter-clockwise).

        Parameters
        ----------
        front, left, right : float or None
            Distances, m; infinite where nothing is, None where a sensor is silent.
        """
        if front < self.back_off:
            return -self.scale_linear, 0.0
        if front <= self.follow:
            return 0.0, 0.0
        if front <= self.lost:
            return self.scale_linear, 0.0
        is_left = left is not None and left <= self.lost
        is_right = right is not None and right <= self.lost
        return 0.0, self.scale_angular * (is_left - is_right)
