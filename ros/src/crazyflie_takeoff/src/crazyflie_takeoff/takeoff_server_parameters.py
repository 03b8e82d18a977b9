"""The parameters of the takeoff server."""

from collections.abc import Iterator
from typing import Any

from typing_extensions import override

from crazyflie_takeoff.flight_topics import FlightTopicParameters, derived_topic
from crazyflie_takeoff.limits import Box
from crazyflie_takeoff.server_table import Plan
from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import DURATION, METRES, SERVICE, TOPIC, Number

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

    control_topic: str = parameter(
        TOPIC, "thrust of takeoff and landing goes here", name="topics/control"
    )
    reference_topic: str = parameter(
        TOPIC, "hover point and descent go here", name="topics/reference"
    )
    own_descent_topic: str | None = parameter(
        TOPIC,
        "the descent goes here, too; by default the name of reference + `_descent`",
        None,
        "topics/descent_reference",
    )
    own_flight_state_topic: str | None = parameter(
        TOPIC, "by default the name of in_flight + `_state`", None, "topics/flight_state"
    )
    own_status_topic: str | None = parameter(
        TOPIC, "by default the name of in_flight + `_status`", None, "topics/status"
    )
    state_topic: str | None = parameter(
        TOPIC, "where the vehicle is; without it nothing is known", None, "topics/state"
    )
    battery_topic: str | None = parameter(
        TOPIC, "the battery's voltage; without it none is watched", None, "topics/battery"
    )
    connected_topic: str | None = parameter(
        TOPIC,
        "whether the driver is connected; with it /takeoff is refused while it is not",
        None,
        "topics/connected",
    )
    own_vehicle_status_topic: str | None = parameter(
        TOPIC,
        "the vehicle's state; /takeoff of one that is locked, crashed or overturned is refused. "
        "By default `vehicle_status` next to topics/connected",
        None,
        "topics/vehicle_status",
    )
    inhibition_topic: str | None = parameter(
        TOPIC,
        "why another node refuses takeoffs; empty text if it does not",
        None,
        "topics/inhibition",
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
        Number("V", minimum=0.0), "with less /takeoff is refused", 3.2, "battery/low"
    )
    battery_critical: float = parameter(
        Number("V", minimum=0.0),
        "with less in flight the vehicle is landed",
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

    descent_topic = derived_topic("own_descent_topic", "reference_topic", "_descent")
    flight_state_topic = derived_topic("own_flight_state_topic", "in_flight_topic", "_state")
    status_topic = derived_topic("own_status_topic", "in_flight_topic", "_status")

    @property
    def vehicle_status_topic(self) -> str | None:
        """The driver's status of the vehicle; None without a driver."""
        if self.own_vehicle_status_topic is not None or self.connected_topic is None:
            return self.own_vehicle_status_topic
        return self._of_driver("vehicle_status")

    @property
    def positioning_topic(self) -> str | None:
        """Why the vehicle's own estimate cannot be flown by; None without a driver."""
        return None if self.connected_topic is None else self._of_driver("positioning")

    def _of_driver(self, name):
        namespace, slash, _ = (self.connected_topic or "").rpartition("/")
        return f"{namespace}{slash}{name}"

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

    def plan(self) -> Plan:
        """Return the durations and the speed of takeoffs and landings."""
        return Plan(self.hover, self.open_loop, self.settle, self.descent_speed)


def hover_complaint(hover: tuple[float, float, float], box: Box) -> str:
    """Return in words what is wrong with a hover point (m) in a box; empty if nothing is."""
    excess = box.excess(hover)
    if excess <= 0.0:
        return ""
    return (
        f"hover/x, y, z is {hover}, {excess:.2f} m outside the geofence; expected a point in the "
        "box"
    )
