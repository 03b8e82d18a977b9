"""Events of a flight in the messages of a bag: faults and changes, with their times."""

import itertools
import math
import re
from array import array
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any

from crazyflie_model.supervisor import SupervisorState
from crazyflie_msgs.msg import FilterStatus, FlightStatus, VehicleStatus

MERGE_TIME = 1.0  #: Time within which repetitions are one event (s).
MAX_EVENTS = 20_000  #: Largest number of events of a bag; more are only counted.

_WARN, _ERROR = 4, 8  # Levels of rosgraph_msgs/Log.
_ROS2_LEVELS = {30: _WARN, 40: _ERROR, 50: _ERROR}  # Levels of rcl_interfaces/Log.
_FILTER_STATES = {
    FilterStatus.HOLDING: "holding",
    FilterStatus.SINKING: "sinking",
    FilterStatus.DOWN: "down",
    FilterStatus.EMERGENCY: "emergency",
}
_LOW_BATTERIES = {
    VehicleStatus.BATTERY_LOW: "battery low",
    VehicleStatus.BATTERY_CRITICAL: "battery critical",
}


class Kind(Enum):
    """Kind of an event."""

    REFUSAL = "refusal"
    REJECTED = "pose rejected"
    HOLD = "hold"
    EMERGENCY = "emergency"
    LINK = "link"
    BATTERY = "battery"
    PARAMETER = "parameter"
    WARNING = "warning"
    ERROR = "error"


@dataclass
class Event:
    """An event of a flight."""

    time: float  #: Time of the recording (s).
    namespace: str  #: Namespace of the node or topic that it comes from.
    kind: Kind
    text: str
    count: int = 1  #: Repetitions.


class EventLog:
    """Events, collected from messages in the order of their times."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.dropped = 0  #: Number of events beyond `MAX_EVENTS`.
        #: By namespace, times (s) and states of the flight (constants of FlightStatus).
        self.flight_states: dict[str, list[tuple[float, int]]] = defaultdict(list)
        #: By namespace: time (s), fraction of answered pings, and number of setpoints that were not
        #: sent so far.
        self.links: dict[str, array[float]] = defaultdict(lambda: array("d"))
        self._last: dict[Any, Any] = {}
        self._latest: dict[tuple[str, Kind, str], tuple[float, Event]] = {}

    def add(self, time: float, topic: str, namespace: str, datatype: str, message: Any) -> None:
        """Add the events in a message of a type of `bag_topics.EVENT_TYPES` but tf's."""
        for source, kind, text in self._READERS[datatype](self, time, topic, namespace, message):
            self._add(time, source, kind, text)

    def _add(self, time, namespace, kind, text):
        key = (namespace, kind, text)
        last, event = self._latest.get(key, (-math.inf, None))
        if event is not None and time - last <= MERGE_TIME:
            event.count += 1
        elif len(self.events) >= MAX_EVENTS:
            self.dropped += 1
            return
        else:
            event = Event(time, namespace, kind, text)
            self.events.append(event)
        self._latest[key] = time, event

    def _changes(self, key, value):
        """Return whether a value differs from the last one of this key."""
        changes = self._last.get(key) != value
        self._last[key] = value
        return changes

    def _flight_status(self, time, topic, namespace, message):
        if self._changes((topic, "state"), message.state):
            self.flight_states[namespace].append((time, message.state))
        if self._changes((topic, "reason"), message.reason) and message.reason:
            is_hold = message.state == FlightStatus.FLYING
            yield namespace, Kind.HOLD if is_hold else Kind.WARNING, message.reason
        if message.state == FlightStatus.ON_GROUND:
            refusal = message.takeoff_refusal
            if self._changes((topic, "refusal"), refusal) and refusal:
                yield namespace, Kind.REFUSAL, f"takeoff would be refused: {refusal}"

    def _filter_status(self, time, topic, namespace, message):
        if self._changes(topic, message.state) and message.state != FilterStatus.PASSING:
            kind = Kind.HOLD if message.state == FilterStatus.HOLDING else Kind.EMERGENCY
            name = _FILTER_STATES.get(message.state, "?")
            yield namespace, kind, f"the filter is {name}: {message.reason}"

    def _vehicle_status(self, time, topic, namespace, message):
        quality, ignored = message.link_quality, message.setpoints_ignored
        self.links[namespace].extend((time, quality, ignored))
        if self._changes((topic, "link"), message.link) and message.link == VehicleStatus.LOST:
            yield namespace, Kind.LINK, message.link_text
        faults = SupervisorState(message.supervisor).faults
        if self._changes((topic, "faults"), faults) and faults:
            yield namespace, Kind.ERROR, f"the vehicle cannot fly: {faults.words()}"
        if self._changes((topic, "emergency"), message.is_emergency) and message.is_emergency:
            yield namespace, Kind.EMERGENCY, message.text
        low = _LOW_BATTERIES.get(message.battery)
        if self._changes((topic, "battery"), message.battery) and low:
            yield namespace, Kind.BATTERY, f"{low}: {message.battery_voltage:.2f} V"

    def _parameters(self, time, topic, namespace, message):
        node = topic.rpartition("/")[0]
        for each in itertools.chain(message.bools, message.ints, message.strs, message.doubles):
            key = (topic, each.name)
            is_known = key in self._last
            if self._changes(key, each.value) and is_known:
                yield namespace, Kind.PARAMETER, f"{node}/{each.name} is now {each.value}"

    def _rosout(self, time, topic, namespace, message):
        # The same message comes on /rosout and on /rosout_agg.
        if self._changes(("log", message.name, message.msg), message.header.stamp.to_nsec()):
            yield from _line_of_log(message.name, message.msg, message.level)

    def _ros2_rosout(self, time, topic, namespace, message):
        name = f"/{message.name.replace('.', '/')}"
        yield from _line_of_log(name, message.msg, _ROS2_LEVELS.get(message.level, 0))

    def _diagnostics(self, time, topic, namespace, message):
        for status in message.status:
            source = _parent(status.name.partition(":")[0])
            for each in status.values:
                if each.key.startswith("rejected: "):
                    yield from self._rejections(source, status.name, each)
            if self._changes((topic, status.name), (status.level, status.message)) and status.level:
                kind = Kind.ERROR if status.level > 1 else Kind.WARNING
                yield source, kind, f"{status.name}: {status.message}"

    def _rejections(self, source, name, each):
        key = ("rejected", name, each.key)
        before = self._last.get(key, 0)
        count = int(each.value) if each.value.isdigit() else 0
        self._last[key] = count
        if count > before:
            yield source, Kind.REJECTED, f"a pose {each.key.removeprefix('rejected: ')} ({name})"

    _READERS = {
        "crazyflie_msgs/FlightStatus": _flight_status,
        "crazyflie_msgs/FilterStatus": _filter_status,
        "crazyflie_msgs/VehicleStatus": _vehicle_status,
        "dynamic_reconfigure/Config": _parameters,
        "rosgraph_msgs/Log": _rosout,
        "rcl_interfaces/Log": _ros2_rosout,
        "diagnostic_msgs/DiagnosticArray": _diagnostics,
    }


def concerning(events: list[Event], name: str, names: set[str]) -> Iterator[Event]:
    """Yield the events of a vehicle, and those that belong to no other one of these namespaces."""
    others = names - {name, ""}
    for event in events:
        words = {word.strip("/").split("/")[0] for word in re.findall(r"[\w/]+", event.text)}
        if event.namespace == name or not (event.namespace in others or words & others):
            yield event


def _line_of_log(name, line, level):
    """Yield the event of a line of a log, if any."""
    own_name = re.match(r"(/\S+): ", line)
    node = own_name[1] if own_name else name
    if "refused" in line:
        kind = Kind.REFUSAL
    elif "rejected" in line:
        kind = Kind.REJECTED
    elif level >= _WARN:
        kind = Kind.ERROR if level >= _ERROR else Kind.WARNING
    else:
        return
    yield _parent(node), kind, line if own_name else f"{node}: {line}"


def _parent(node):
    return node.strip("/").rpartition("/")[0]
