"""Parameters of the takeoff server."""

from collections.abc import Iterator
from typing import Any

from typing_extensions import override

from crazyflie_model.limits import MAX_THRUST
from crazyflie_takeoff.envelope import hover_complaint
from crazyflie_takeoff.flight_topics import FlightTopicParameters, derived_topic, named_after
from crazyflie_takeoff.profiles import RAMP_DURATION, TakeoffPlan
from crazyflie_utils import parameter, topic
from crazyflie_utils.parameters.types import DURATION, METRES, SERVICE, Number

SLOWEST_DESCENT = 0.05  #: A slower descent would hardly ever end (m/s).
FASTEST_DESCENT = 1.0  #: A vehicle meets the ground with the speed of its descent (m/s).
#: Without a controller a vehicle climbs by 2.5 m in this time (s): half of 0.2 m/s^2 times t^2.
LONGEST_OPEN_LOOP = 5.0


class DescentSpeed(Number):
    """Type of the speed of a descent, or 0."""

    @property
    @override
    def range(self) -> str:  # type: ignore[override]
        return f"0, or {SLOWEST_DESCENT:g} to {self.maximum:g}"

    @override
    def __call__(self, value: Any) -> float:
        speed = super().__call__(value)
        if 0.0 < speed < SLOWEST_DESCENT:
            raise ValueError
        return speed

    @override
    def __str__(self) -> str:
        return f"{self.range} ({self.unit})"


class TakeoffServerParameters(FlightTopicParameters):
    """Parameters of `TakeoffServerNode`."""

    control_topic: str = topic("control", "thrust of takeoff and landing goes here")
    reference_topic: str = topic("reference", "hover point and descent go here")
    own_descent_topic: str | None = topic(
        "descent_reference",
        "the descent goes here, too; by default the name of reference + `_descent`",
        None,
    )
    own_status_topic: str | None = named_after("in_flight", "_status")
    battery_topic: str | None = topic(
        "battery", "voltage of the battery; without it the battery is not monitored", None
    )
    inhibition_topic: str | None = topic(
        "inhibition", "why another node refuses takeoffs; empty text if it does not", None
    )
    takeoff_service: str = parameter(SERVICE, "takes off", "/takeoff", "srv/takeoff")
    land_service: str = parameter(SERVICE, "lands", "/land", "srv/land")
    hover_x: float = parameter(METRES, "hover point after takeoff", name="hover/x", live=True)
    hover_y: float = parameter(METRES, "hover point after takeoff", name="hover/y", live=True)
    hover_z: float = parameter(METRES, "hover point after takeoff", name="hover/z", live=True)
    open_loop: float = parameter(
        Number("s", minimum=0.0, maximum=LONGEST_OPEN_LOOP),
        "how long thrust g + 0.2 lifts off; 0 leaves it to the controller",
        1.0,
        "duration/open_loop",
    )
    thrust: float | None = parameter(
        Number("m/s^2", above=0.0, maximum=MAX_THRUST),
        "thrust of the liftoff, by default g + 0.2; a landing's ramp goes from it to 9.0 then, "
        "and by default from g to g - 5",
        None,
        "takeoff/thrust",
    )
    ramp: float = parameter(
        Number("s", minimum=0.1, maximum=10.0),
        "how long the thrust of a landing decreases before it is zero",
        RAMP_DURATION,
        "duration/landing",
    )
    settle: float = parameter(
        DURATION, "how long the controller has to reach the hover point", 5.0, "duration/hover"
    )
    descent_speed: float = parameter(
        DescentSpeed("m/s", minimum=0.0, maximum=FASTEST_DESCENT),
        "how fast a landing sinks before the ramp; 0 for the bare ramp",
        0.3,
        "landing/descent_speed",
        live=True,
    )
    battery_low: float = parameter(
        Number("V", minimum=0.0), "voltage below which /takeoff is refused", 3.2, "battery/low"
    )
    battery_critical: float = parameter(
        Number("V", minimum=0.0),
        "voltage below which the vehicle is landed in flight",
        3.0,
        "battery/critical",
    )
    battery_duration: float = parameter(
        DURATION,
        "how long the voltage must be lower; with 0 a single low voltage is enough",
        5.0,
        "battery/duration",
    )

    ground: float = parameter(
        METRES,
        "z where the last takeoff began, which the server notes for one that takes its place",
        0.0,
    )

    descent_topic = derived_topic("descent", "reference", "_descent")
    status_topic = derived_topic("status", "in_flight", "_status")

    @property
    def positioning_topic(self) -> str | None:
        """Why the vehicle's own estimate cannot be flown by; None without a driver."""
        return self._of_driver("positioning")

    @override
    def complaints(self) -> Iterator[str]:
        if complaint := hover_complaint(self.hover, self.box):
            yield complaint
        if self.battery_critical > self.battery_low:
            yield (
                f"battery/critical is {self.battery_critical:g}; expected at most battery/low, "
                f"which is {self.battery_low:g} V"
            )

    @property
    def hover(self) -> tuple[float, float, float]:
        """The hover point, m."""
        return self.hover_x, self.hover_y, self.hover_z

    def plan(self) -> TakeoffPlan:
        """Return the durations and the speed of takeoffs and landings."""
        return TakeoffPlan(
            self.hover, self.open_loop, self.settle, self.descent_speed, self.ramp, self.thrust
        )
