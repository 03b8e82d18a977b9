"""The topics on which server and filter tell each other about a flight."""

from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameter_types import TOPIC


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
    own_controller_topic: str | None = parameter(
        TOPIC, "by default the name of in_flight + `_controller`", None, "topics/controller"
    )

    @property
    def flight_state_topic(self) -> str:
        """The server's flight state."""
        return self.own_flight_state_topic or f"{self.in_flight_topic}_state"

    @property
    def filter_state_topic(self) -> str:
        """What the filter remembers."""
        return self.own_filter_state_topic or f"{self.in_flight_topic}_filter"

    @property
    def controller_topic(self) -> str:
        """Whether the filter sees a controller."""
        return self.own_controller_topic or f"{self.in_flight_topic}_controller"
