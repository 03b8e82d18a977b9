"""What server and filter are both told: their topics, and where the vehicle may be."""

import math

from crazyflie_takeoff.limits import NO_BOX, Box
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import METRES, TOPIC


class CornerParameters(Parameters):
    """A corner of the geofence's box, named as the geofence names it."""

    x: float | None = parameter(METRES, "corner of the geofence; without it there is no wall", None)
    y: float | None = parameter(METRES, "corner of the geofence; without it there is no wall", None)
    z: float | None = parameter(METRES, "corner of the geofence; without it there is no wall", None)

    def vector(self, missing: float) -> tuple[float, ...]:
        """Return x, y, z in m, and what stands for a missing one."""
        return tuple(missing if value is None else value for value in (self.x, self.y, self.z))


class FlightTopicParameters(Parameters):
    """Parameters that server and filter share."""

    in_flight_topic: str = parameter(
        TOPIC, "toggles between ground and flight", name="topics/in_flight"
    )
    own_flight_state_topic: str | None = parameter(
        TOPIC, "by default the name of in_flight + `_state`", None, "topics/flight_state"
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
        "the geofence's live parameters, of which the box counts in the place of box/min and "
        "box/max: the name of its node + `/parameter_updates`",
        None,
        "topics/box",
    )
    lower: CornerParameters = group(CornerParameters, "box/min")
    upper: CornerParameters = group(CornerParameters, "box/max")

    @property
    def box(self) -> Box:
        """The geofence's box at the start; with `box_topic` there is none until that tells."""
        if self.box_topic is not None:
            return NO_BOX
        return Box(self.lower.vector(-math.inf), self.upper.vector(math.inf))

    @property
    def flight_state_topic(self) -> str:
        """The server's flight state."""
        return self.own_flight_state_topic or f"{self.in_flight_topic}_state"

    @property
    def filter_state_topic(self) -> str:
        """What the filter remembers."""
        return self.own_filter_state_topic or f"{self.in_flight_topic}_filter"

    @property
    def flight_status_topic(self) -> str:
        """The server's flight state and what it knows, typed."""
        return self.own_flight_status_topic or f"{self.in_flight_topic}_flight_status"

    @property
    def filter_status_topic(self) -> str:
        """What the filter does, typed."""
        return self.own_filter_status_topic or f"{self.in_flight_topic}_filter_status"

    @property
    def controller_topic(self) -> str:
        """Whether the filter sees a controller."""
        return self.own_controller_topic or f"{self.in_flight_topic}_controller"
