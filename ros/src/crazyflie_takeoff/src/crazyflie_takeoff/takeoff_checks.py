"""Parameters of the takeoff server, and checks before a takeoff."""

import enum
import math
from collections.abc import Callable, Iterator
from typing import Any

from typing_extensions import override

from crazyflie_takeoff.flight_topics import FlightTopicParameters, derived_topic, named_after
from crazyflie_takeoff.limits import Box
from crazyflie_takeoff.motion import MeasuredPosition
from crazyflie_takeoff.server_table import FilterReport, ServerEvent, TakeoffPlan
from crazyflie_takeoff.vehicle_facts import VehicleFacts
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
    own_flight_state_topic: str | None = named_after("in_flight", "_state", "flight_state")
    own_hover_thrust_topic: str | None = named_after("in_flight", "_hover_thrust")
    own_status_topic: str | None = named_after("in_flight", "_status")
    state_topic: str | None = topic(
        "state", "states of the vehicle; without them its position is unknown", None
    )
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
    hover_thrust_topic = derived_topic("hover_thrust", "in_flight", "_hover_thrust")
    flight_state_topic = derived_topic("flight_state", "in_flight", "_state")
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
        return TakeoffPlan(self.hover, self.open_loop, self.settle, self.descent_speed)


def hover_complaint(hover: tuple[float, float, float], box: Box) -> str:
    """Return in words what is wrong with a hover point (m) in a box; empty if nothing is."""
    excess = box.excess(hover)
    if excess <= 0.0:
        return ""
    return (
        f"hover/x, y, z is {hover}, {excess:.2f} m outside the geofence; expected a point in the "
        "box"
    )


MAX_VOLTAGE_AGE = 5.0  #: Age at which a voltage is unknown (s); the driver sends one a second.
_LONGEST_STEP = 1.5  #: Longest time between two voltages that is added to a duration (s).
_NOT_LOWER = -math.inf  # Duration below a level of a voltage that is not below it (s).
_NO_CONTROLLER = "no commanded controls come; is the controller running?"


class Charge(enum.Enum):
    """Charge of a battery."""

    UNKNOWN = enum.auto()
    GOOD = enum.auto()
    LOW = enum.auto()
    CRITICAL = enum.auto()


class BatteryCheck:
    """The charge of a battery, from the time for which its voltage has been below two levels (V).

    In flight the voltage sags with every burst of thrust. So it must stay low for ``duration``
    (s); if that is 0, a single low voltage is enough.
    """

    def __init__(self, low: float, critical: float, duration: float):
        self._levels = (critical, low)
        self._duration = duration
        self._lasted = [_NOT_LOWER, _NOT_LOWER]
        self.voltage = math.nan
        self._time = math.inf  # s; infinite before the first voltage.

    def measure(self, time: float, voltage: float) -> None:
        """Record a voltage (V) that was measured at ``time`` (s)."""
        step = min(max(time - self._time, 0.0), _LONGEST_STEP)
        self._lasted = [
            max(lasted + step, 0.0) if voltage < level else _NOT_LOWER
            for lasted, level in zip(self._lasted, self._levels, strict=True)
        ]
        self.voltage, self._time = voltage, time

    def charge(self, time: float) -> Charge:
        """Return the charge at ``time`` (s)."""
        if not abs(time - self._time) < MAX_VOLTAGE_AGE:
            return Charge.UNKNOWN
        critical, low = (lasted >= self._duration for lasted in self._lasted)
        if critical:
            return Charge.CRITICAL
        return Charge.LOW if low else Charge.GOOD


class TakeoffChecks:
    """Facts about estimator, controller, driver, battery and geofence, and refusals by them.

    ``resolve(topic)`` returns the absolute name of a topic. ``parameters`` may be replaced by
    others of the same topics.
    """

    def __init__(self, parameters: TakeoffServerParameters, resolve: Callable[[str], str]):
        self.parameters = parameters
        self.box = parameters.box
        self.position = MeasuredPosition()
        #: What the driver publishes about the vehicle.
        self.vehicle = VehicleFacts(parameters.connected_topic, resolve)
        self.battery = BatteryCheck(
            parameters.battery_low, parameters.battery_critical, parameters.battery_duration
        )
        # The filter publishes it, and there may be no filter.
        self.has_controller = True
        self._had_controller = False
        topic = parameters.inhibition_topic
        # Reason for which another node refuses takeoffs; empty if it does not.
        self.inhibition = "" if topic is None else f"nothing has come on {resolve(topic)}"
        self._resolve = resolve
        #: Why the vehicle's own positioning cannot be flown by; empty if it can, or has none.
        self.positioning = ""

    def set_box(self, box: Box) -> None:
        """Set the box of the geofence."""
        self.box = box

    def set_controller(self, has_controller: bool) -> None:
        """Record whether the filter sees a controller."""
        self.has_controller = has_controller
        self._had_controller = self._had_controller or has_controller

    def may_become_complete(self, now: float) -> bool:
        """Return whether something is missing at ``now`` (s) that has never been there."""
        lacks_state = self.parameters.state_topic is not None and not self.position.is_measured
        lacks_controller = not self.has_controller and not self._had_controller
        return lacks_state or lacks_controller or bool(self.vehicle.connection_refusal(now))

    def refusal(self, now: float, report: FilterReport) -> str:
        """Return why the vehicle must not take off at ``now`` (s); empty if it may."""
        if report.event is ServerEvent.FILTER_REFUSES:
            return report.reason
        if report.event is ServerEvent.FILTER_EMERGENCY:
            return f"emergency, {report.reason}; reset it first"
        topic = self.parameters.state_topic
        return (
            hover_complaint(self.parameters.hover, self.box)
            or self.vehicle.takeoff_refusal(now)
            or self.positioning
            or (topic and self.position.explanation(now, self._resolve(topic)))
            or ("" if self.has_controller else _NO_CONTROLLER)
            or self.inhibition
            or self.battery_complaint(now)
        )

    def battery_complaint(self, now: float) -> str:
        """Return that the battery is low or critical; empty if it is not."""
        if self.battery.charge(now) in (Charge.LOW, Charge.CRITICAL):
            return f"the battery is low, {self.battery.voltage:.2f} V"
        return ""
