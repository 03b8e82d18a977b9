"""The state of a vehicle's flight, as its takeoff server publishes it."""

from collections.abc import Callable

from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils.handle import NodeHandle
from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC, Converted

_TREE = Converted(dict, "a namespace")

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
    """Topics of a takeoff server, for a group of the prefix "topics"."""

    in_flight: str | None = parameter(
        TOPIC,
        "topics/in_flight of the takeoff server, after which its other topics are named; by "
        "default that of the nodes in the same namespace, or else `in_flight`",
        None,
        name="in_flight",
    )
    status: str | None = parameter(
        TOPIC,
        "flight status of the takeoff server; by default the name of in_flight + `_flight_status`",
        None,
        name="flight_status",
    )

    def derived(self, handle: NodeHandle, suffix: str) -> str:
        """Return a topic of the takeoff server; asks the master."""
        return (self.in_flight or in_flight_of(handle, _namespace(handle))) + suffix

    def subscribe(self, handle: NodeHandle, callback: Callable[[FlightStatus], None]) -> None:
        """Call ``callback(status)`` for each flight status."""
        status = self.status or self.derived(handle, "_flight_status")
        handle.subscribe(status, FlightStatus, callback)


def in_flight_of(handle: NodeHandle, namespace: str) -> str:
    """Return topics/in_flight of the nodes in a namespace; asks the master.

    It is ``in_flight`` below the namespace if they name none, or several.
    """
    nodes = handle.get_param(namespace or "/", _TREE, {}).values()
    groups = [each.get("topics") for each in nodes if isinstance(each, dict)]
    found = {
        str(each["in_flight"]) for each in groups if isinstance(each, dict) and "in_flight" in each
    }
    name = found.pop() if len(found) == 1 else "in_flight"
    return name if name.startswith("/") else f"{namespace}/{name}"


def _namespace(handle):
    return handle.resolve("in").rpartition("/")[0]
