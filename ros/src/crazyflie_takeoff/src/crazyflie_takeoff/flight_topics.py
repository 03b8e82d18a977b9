"""Parts of server and filter: their parameters of topics, box, driver, and diagnostics."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from dynamic_reconfigure.msg import Config
from std_msgs.msg import Bool

from crazyflie_model.supervisor import SupervisorState
from crazyflie_msgs.msg import VehicleStatus
from crazyflie_takeoff.envelope import NO_BOX, Box
from crazyflie_takeoff.vehicle_facts import VehicleFacts
from crazyflie_utils import NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import METRES

DIAGNOSTICS_PERIOD = 1.0  #: Period of the diagnostics, as REP 107 recommends (s).

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class CornerParameters(Parameters):
    """A corner of the geofence's box, named as the geofence names it."""

    x: float | None = parameter(METRES, "corner of the geofence; without it there is no wall", None)
    y: float | None = parameter(METRES, "corner of the geofence; without it there is no wall", None)
    z: float | None = parameter(METRES, "corner of the geofence; without it there is no wall", None)

    def vector(self, missing: float) -> tuple[float, ...]:
        """Return x, y, z in m; ``missing`` for a coordinate without a wall."""
        return tuple(missing if value is None else value for value in (self.x, self.y, self.z))


def named_after(base: str, suffix: str, name: str = "") -> Any:
    """Declare topics/NAME, by default the topic ``base`` with a suffix, which is ``_NAME``."""
    return topic(name or suffix[1:], f"by default the name of {base} + `{suffix}`", None)


def derived_topic(name: str, base: str, suffix: str) -> Any:
    """Return a property: the topic in own_NAME_topic, or else BASE_topic with a suffix, or None."""

    def derived(parameters: Parameters) -> str | None:
        stem = getattr(parameters, f"{base}_topic")
        return getattr(parameters, f"own_{name}_topic") or (None if stem is None else stem + suffix)

    return property(derived)


class FlightTopicParameters(Parameters):
    """Parameters that server and filter share."""

    in_flight_topic: str = topic("in_flight", "toggles between ground and flight")
    own_flight_status_topic: str | None = named_after("in_flight", "_flight_status")
    own_filter_status_topic: str | None = named_after("in_flight", "_filter_status")
    own_hover_thrust_topic: str | None = named_after("in_flight", "_hover_thrust")

    state_topic: str | None = topic(
        "state",
        "where the vehicle is; without it there is no descent, and limits are not watched",
        None,
    )
    own_estimate_status_topic: str | None = named_after("state", "_status", "estimate_status")
    connected_topic: str | None = topic(
        "connected",
        "whether the driver is connected; while it is not /takeoff is refused, and a flight ends",
        None,
    )
    own_vehicle_status_topic: str | None = topic(
        "vehicle_status",
        "the vehicle's state; /takeoff is refused, and a flight ends, while it cannot fly. By "
        "default `vehicle_status` next to topics/connected",
        None,
    )
    box_topic: str | None = topic(
        "box",
        "the geofence's live parameters, whose box replaces box/min and "
        "box/max: the name of its node + `/parameter_updates`",
        None,
    )
    lower: CornerParameters = group(CornerParameters, "box/min")
    upper: CornerParameters = group(CornerParameters, "box/max")

    @property
    def box(self) -> Box:
        """The geofence's box at the start; without walls if `box_topic` provides it."""
        if self.box_topic is not None:
            return NO_BOX
        return Box(self.lower.vector(-math.inf), self.upper.vector(math.inf))

    @property
    def vehicle_status_topic(self) -> str | None:
        """The driver's status of the vehicle; None without a driver."""
        return self.own_vehicle_status_topic or self._of_driver("vehicle_status")

    def _of_driver(self, name):
        if self.connected_topic is None:
            return None
        namespace, slash, _ = self.connected_topic.rpartition("/")
        return f"{namespace}{slash}{name}"

    estimate_status_topic = derived_topic("estimate_status", "state", "_status")
    flight_status_topic = derived_topic("flight_status", "in_flight", "_flight_status")
    filter_status_topic = derived_topic("filter_status", "in_flight", "_filter_status")
    hover_thrust_topic = derived_topic("hover_thrust", "in_flight", "_hover_thrust")


def follow_box(handle: NodeHandle, topic: str, callback: Callable[[Box], None]) -> None:
    """Call ``callback(box)`` with the box of a geofence, now and after each change.

    ``topic`` has the geofence's live parameters, latched; without a corner there is no wall.
    """

    def on_config(message: Config) -> None:
        values = {each.name: each.value for each in message.doubles}
        lower = tuple(values.get(f"box/min/{axis}", -math.inf) for axis in "xyz")
        upper = tuple(values.get(f"box/max/{axis}", math.inf) for axis in "xyz")
        callback(Box(lower, upper))

    handle.subscribe(topic, Config, on_config)


def follow_driver(
    handle: NodeHandle, parameters: FlightTopicParameters, facts: VehicleFacts
) -> None:
    """Keep facts up to date with what the driver publishes."""

    def on_connected(message: Bool) -> None:
        facts.set_connected(handle.time(), message.data)

    def on_status(message: VehicleStatus) -> None:
        state = SupervisorState(message.supervisor)
        facts.set_status(handle.time(), state, message.has_supervisor, message.is_emergency)

    if parameters.connected_topic is not None:
        handle.subscribe(parameters.connected_topic, Bool, on_connected)
    if parameters.vehicle_status_topic is not None:
        handle.subscribe(parameters.vehicle_status_topic, VehicleStatus, on_status)


def report(
    handle: NodeHandle, level: int, message: str, figures: Mapping[str, str]
) -> DiagnosticArray:
    """Return diagnostics of a node; the keys of the figures contain the units."""
    status = DiagnosticStatus(
        level=level,
        name=handle.name.lstrip("/"),
        message=message,
        values=[KeyValue(key, value) for key, value in figures.items()],
    )
    array = DiagnosticArray(status=[status])
    array.header.stamp = handle.stamp()
    return array
