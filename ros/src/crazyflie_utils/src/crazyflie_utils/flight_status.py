"""The state of a vehicle's flight, as its takeoff server publishes it: typed, or as text."""

from collections.abc import Callable

from std_msgs.msg import String

from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils.handle import NodeHandle

#: Constant of `FlightStatus` to words.
WORDS = {
    FlightStatus.UNKNOWN: "not known to fly",
    FlightStatus.ON_GROUND: "on the ground",
    FlightStatus.TAKING_OFF: "taking off",
    FlightStatus.FLYING: "flying",
    FlightStatus.DESCENDING: "descending",
    FlightStatus.LANDING: "landing",
}


def subscribe(
    handle: NodeHandle,
    topic: str | None,
    text_topic: str | None,
    callback: Callable[[FlightStatus], None],
) -> None:
    """Call ``callback(status)`` for each flight status on a topic, if there is one.

    A takeoff server without flight status has a ``text_topic`` of std_msgs/String: names of states
    in small letters; any other text is `FlightStatus.UNKNOWN`.
    """
    if topic is not None:
        handle.subscribe(topic, FlightStatus, callback)
    if text_topic is not None:
        handle.subscribe(text_topic, String, lambda message: callback(_from_text(message.data)))


def _from_text(text):
    return FlightStatus(state=getattr(FlightStatus, text.upper(), FlightStatus.UNKNOWN))
