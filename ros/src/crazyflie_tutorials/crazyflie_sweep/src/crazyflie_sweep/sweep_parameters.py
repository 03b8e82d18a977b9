"""Parameters of a sweep."""

from collections.abc import Iterator

from typing_extensions import override

from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import (
    BOOLEAN,
    FRAME,
    METRES,
    SERVICE,
    TIME_STEP,
    TOPIC,
    Integer,
    Number,
)

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


class SweepParameters(SweepPlan):
    """Parameters of `SweepNode`."""

    velocity_limit: float = parameter(
        TIME_STEP,
        "time for which an answer of the velocity service is valid",
        0.5,
        "velocity/limit",
    )
    velocity_most: float = parameter(
        Number(above=0.0), "largest valid answer; it must also be > 0", 3.0, "velocity/most"
    )
    start: bool = parameter(
        BOOLEAN, "begin as soon as a vehicle is present; otherwise wait for `~start`", True
    )
    fixed_frame: str = parameter(FRAME, "frame of the area", "world", "frames/fixed")
    takeoff_service: str = parameter(SERVICE, "takes off", "/takeoff", "srv/takeoff")
    land_service: str = parameter(SERVICE, "lands", "/land", "srv/land")
    velocity_service: str = parameter(
        SERVICE, "service with the velocity for a position", "oscillator", "srv/velocity"
    )
    state_topic: str = parameter(TOPIC, "states of the vehicle", name="topics/state")
    reference_topic: str = parameter(TOPIC, "where references go", name="topics/reference")
    flight_status_topic: str = parameter(
        TOPIC,
        "flight status of the takeoff server",
        "in_flight_flight_status",
        "topics/flight_status",
    )
    flight_state_topic: str | None = parameter(
        TOPIC, "text of a takeoff server without flight status", None, "topics/flight_state"
    )
    report_topic: str = parameter(TOPIC, "status of the sweep", "~report", "topics/report")
    velocity_topic: str = parameter(
        TOPIC, "speed of the reference, as `Vel` linear", "~velocity", "topics/velocity"
    )
    markers_topic: str = parameter(TOPIC, "for RViz", "~markers", "topics/markers")
