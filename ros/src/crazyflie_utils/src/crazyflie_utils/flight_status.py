"""The state of a vehicle's flight, as its takeoff server publishes it: typed, or as text."""

from collections.abc import Callable

from std_msgs.msg import String

from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils.handle import NodeHandle

WORDS = {
    FlightStatus.UNKNOWN: "not known to fly",
    FlightStatus.ON_GROUND: "on the ground",
    FlightStatus.TAKING_OFF: "taking off",
    FlightStatus.FLYING: "flying",
    FlightStatus.DESCENDING: "descending",
    FlightStatus.LANDING: "landing",
}
"""Constant of `FlightStatus` to words."""


def subscribe(
    handle: NodeHandle,
    topic: str,
    text_topic: str | None,
    callback: Callable[[FlightStatus], None],
) -> None:
    """Have ``callback(status)`` called for each flight status.

    Parameters
    ----------
    handle : NodeHandle
    topic : str
        Of crazyflie_msgs/FlightStatus.
    text_topic : str or None
        Of std_msgs/String, for a takeoff server without flight status: names of states in small
        letters; any other text is `FlightStatus.UNKNOWN`.
    callback : callable
    """
    handle.subscribe(topic, FlightStatus, callback)
    if text_topic is not None:
        handle.subscribe(text_topic, String, lambda message: callback(_from_text(message.data)))


def _from_text(text):
    return FlightStatus(state=getattr(FlightStatus, text.upper(), FlightStatus.UNKNOWN))
