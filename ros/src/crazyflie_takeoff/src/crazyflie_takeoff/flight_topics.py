"""Parts of server and filter: parameters of topics and geofence, its box, and diagnostics."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from dynamic_reconfigure.msg import Config

from crazyflie_takeoff.limits import NO_BOX, Box
from crazyflie_utils import NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import METRES, TOPIC

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


def derived_topic(own: str, base: str, suffix: str) -> Any:
    """Return a property: the topic in ``own``, or else that in ``base`` with a suffix, or None."""

    def topic(parameters: Parameters) -> str | None:
        name = getattr(parameters, base)
        return getattr(parameters, own) or (None if name is None else name + suffix)

    return property(topic)


class FlightTopicParameters(Parameters):
    """Parameters that server and filter share."""

    in_flight_topic: str = parameter(
        TOPIC, "toggles between ground and flight", name="topics/in_flight"
    )
    own_filter_state_topic: str | None = parameter(
        TOPIC, "by default the name of in_flight + `_filter`", None, "topics/filter_state"
    )
    own_flight_status_topic: str | None = parameter(
        TOPIC, "by default the name of in_flight + `_flight_status`", None, "topics/flight_status"
    )
    own_filter_status_topic: str | None = parameter(
        TOPIC, "by default the name of in_flight + `_filter_status`", None, "topics/filter_status"
    )
    own_controller_topic: str | None = parameter(
        TOPIC, "by default the name of in_flight + `_controller`", None, "topics/controller"
    )

    box_topic: str | None = parameter(
        TOPIC,
        "the geofence's live parameters, whose box replaces box/min and "
        "box/max: the name of its node + `/parameter_updates`",
        None,
        "topics/box",
    )
    lower: CornerParameters = group(CornerParameters, "box/min")
    upper: CornerParameters = group(CornerParameters, "box/max")

    @property
    def box(self) -> Box:
        """The geofence's box at the start; without walls if `box_topic` provides it."""
        if self.box_topic is not None:
            return NO_BOX
        return Box(self.lower.vector(-math.inf), self.upper.vector(math.inf))

    filter_state_topic = derived_topic("own_filter_state_topic", "in_flight_topic", "_filter")
    flight_status_topic = derived_topic(
        "own_flight_status_topic", "in_flight_topic", "_flight_status"
    )
    filter_status_topic = derived_topic(
        "own_filter_status_topic", "in_flight_topic", "_filter_status"
    )
    controller_topic = derived_topic("own_controller_topic", "in_flight_topic", "_controller")


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
