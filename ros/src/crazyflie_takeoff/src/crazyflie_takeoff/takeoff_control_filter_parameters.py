"""Parameters of the takeoff control filter."""

from crazyflie_takeoff.filter_machine import LossTimeouts
from crazyflie_takeoff.flight_topics import FlightTopicParameters, derived_topic
from crazyflie_takeoff.limits import Limits
from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import DURATION, METRES, SERVICE, TOPIC, Number


class TakeoffControlFilterParameters(FlightTopicParameters):
    """Parameters of `TakeoffControlFilterNode`."""

    takeoff_control_topic: str = parameter(
        TOPIC, "the takeoff server's control", name="topics/takeoff_control"
    )
    commanded_control_topic: str = parameter(
        TOPIC, "the controller's control", name="topics/commanded_control"
    )
    final_control_topic: str = parameter(
        TOPIC, "the one that is passed on", name="topics/final_control"
    )
    state_topic: str | None = parameter(
        TOPIC, "where the vehicle is; without it the limits are not watched", None, "topics/state"
    )
    own_tilted_topic: str | None = parameter(
        TOPIC, "by default the name of state + `_tilted`", None, "topics/tilted"
    )
    all_emergency_topic: str = parameter(
        TOPIC, "stops the motors of all vehicles", "/all/emergency", "topics/all_emergency"
    )
    emergency_service: str = parameter(SERVICE, "stops the motors", "/emergency", "srv/emergency")
    reset_service: str = parameter(
        SERVICE, "ends an emergency", "/emergency_reset", "srv/emergency_reset"
    )
    hold: float = parameter(
        DURATION, "control that is older in flight is replaced", 0.1, "loss/hold_after"
    )
    recovery: float = parameter(
        DURATION,
        "how long it may then stay away before the descent, while no state comes, either",
        1.5,
        "loss/return_limit",
    )
    place: float = parameter(
        DURATION, "the same in flight while states come", 3.0, "loss/place_limit"
    )
    descent: float = parameter(
        DURATION,
        "the motors are stopped this long after the descent has begun; later by the time to "
        "sink when the height is known",
        5.0,
        "loss/descent_limit",
    )
    floor: float = parameter(METRES, "lower is below the ground", -0.5, "limits/floor")
    outside: float = parameter(
        Number("m", minimum=0.0), "further outside the geofence is too far", 0.5, "limits/outside"
    )
    climb: float = parameter(
        Number("m/s", above=0.0), "controls do not climb faster", 3.0, "limits/climb"
    )
    height: float = parameter(
        Number("m", above=0.0),
        "controls do not climb higher above the ground",
        10.0,
        "limits/height",
    )

    tilted_topic = derived_topic("own_tilted_topic", "state_topic", "_tilted")

    def timeouts(self) -> LossTimeouts:
        """Return how long the filter waits after a loss."""
        return LossTimeouts(self.hold, self.recovery, self.descent, self.place)

    def limits(self) -> Limits:
        """Return the limits of a flight."""
        box = self.box.without_floor()
        return Limits(box, self.outside, self.floor, self.climb, self.height)
