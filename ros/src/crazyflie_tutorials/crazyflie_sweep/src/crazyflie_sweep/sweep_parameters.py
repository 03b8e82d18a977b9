"""Parameters of a sweep."""

from collections.abc import Iterator

from typing_extensions import override

from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import METRES, Integer, Number

_WIDTH = Number("m", above=0.0)
_SPEED = Number("m/s", above=0.0)


class Area(Parameters):
    """The rectangle to sweep, along the axes of the fixed frame."""

    x_min: float = parameter(METRES, "begin of the area, in the fixed frame", -1.5)
    x_max: float = parameter(METRES, "end of the area", 1.5)
    y_min: float = parameter(METRES, "side of the first lane", -1.5)
    y_max: float = parameter(METRES, "side of the last lane", 1.5)


class SpeedLimits(Parameters):
    """Speeds and acceleration of the reference."""

    min: float = parameter(_SPEED, "least speed on lanes", 0.1)
    max: float = parameter(_SPEED, "largest speed on lanes", 0.7)
    turn: float = parameter(_SPEED, "speed on arcs, and to the first lane", 0.25)
    acceleration: float = parameter(
        Number("m/s^2", above=0.0), "largest acceleration along the path", 0.5
    )


class CoverageGoal(Parameters):
    """Criterion for the coverage of the area."""

    swath: float = parameter(_WIDTH, "diameter of the disc that the vehicle covers", 0.7)
    cell: float = parameter(_WIDTH, "width of the cells that are counted", 0.1)
    goal: float = parameter(
        Number(above=0.0, maximum=1.0), "fraction of the area that must be covered", 0.99
    )
    max_passes: int = parameter(
        Integer(1, 100), "largest number of flights along the lanes, there and back, until then", 2
    )


class SweepPlan(Parameters):
    """Area, lanes, speeds and coverage of a sweep."""

    area: Area = group(Area, "area")
    lane_width: float = parameter(_WIDTH, "largest distance between two lanes", 0.5)
    height: float = parameter(_WIDTH, "height of the lanes above the ground", 1.0)
    speed: SpeedLimits = group(SpeedLimits, "speed")
    coverage: CoverageGoal = group(CoverageGoal, "coverage")

    @override
    def complaints(self) -> Iterator[str]:
        for axis in "xy":
            least = getattr(self.area, f"{axis}_min")
            most = getattr(self.area, f"{axis}_max")
            if not least < most:
                yield f"area/{axis}_min is {least:g}; expected < area/{axis}_max, {most:g} (m)"
        speed = self.speed
        if speed.min > speed.max:
            yield f"speed/min is {speed.min:g}; expected <= speed/max, {speed.max:g} (m/s)"
