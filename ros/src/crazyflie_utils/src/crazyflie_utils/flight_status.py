"""The state of a vehicle's flight, as its takeoff server publishes it: typed, or as text."""

from collections.abc import Callable

from std_msgs.msg import String

from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils.handle import NodeHandle
from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC

#: Constant of `FlightStatus` to words.
WORDS = {
    FlightStatus.UNKNOWN: "not known to fly",
    FlightStatus.ON_GROUND: "on the ground",
    FlightStatus.TAKING_OFF: "taking off",
    FlightStatus.FLYING: "flying",
    FlightStatus.DESCENDING: "descending",
    FlightStatus.LANDING: "landing",
}


class FlightTopics(Parameters):
    """Topics of a takeoff server with the flight status, for a group of the prefix "topics"."""

    status: str | None = parameter(
        TOPIC,
        "flight status of the takeoff server",
        "in_flight_flight_status",
        name="flight_status",
    )
    #: std_msgs/String: names of states in small letters; any other text is `FlightStatus.UNKNOWN`.
    state: str | None = parameter(
        TOPIC, "text of a takeoff server without flight status", None, name="flight_state"
    )

    def subscribe(self, handle: NodeHandle, callback: Callable[[FlightStatus], None]) -> None:
        """Call ``callback(status)`` for each flight status on the topics that are set."""
        if self.status is not None:
            handle.subscribe(self.status, FlightStatus, callback)
        if self.state is not None:
            handle.subscribe(self.state, String, lambda message: callback(_from_text(message.data)))


def _from_text(text):
    return FlightStatus(state=getattr(FlightStatus, text.upper(), FlightStatus.UNKNOWN))
