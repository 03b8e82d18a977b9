"""A vehicle and its topics, which become a `VehicleSnapshot`."""

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import roslib.message
from std_msgs.msg import Float32

from crazyflie_dashboard.discovery import FoundVehicle
from crazyflie_dashboard.frames import Frames
from crazyflie_dashboard.snapshot import STALE_AGE, Kind, Reference, VehicleSnapshot
from crazyflie_driver.msg import GenericLogData
from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_msgs.msg import FilterStatus, FlightStatus, VehicleStatus
from crazyflie_reports.bag_topics import ROLES
from crazyflie_utils import NodeHandle
from crazyflie_utils.flight_status import WORDS

#: Role -> type -> function that returns the row of a message.
_ROWS: dict[str, dict[str, Callable[[Any], Any]]] = defaultdict(dict)
for _role in ROLES:
    _ROWS[_role.name].update(_role.rows)

_SLOW = ("flight_status", "filter_status", "flight_state", "vehicle_status", "battery")

_FILTER_WORDS = {
    FilterStatus.HOLDING: "held by the filter",
    FilterStatus.SINKING: "brought down by the filter",
    FilterStatus.DOWN: "down, motors off",
    FilterStatus.EMERGENCY: "emergency, motors off",
}
_ON_GROUND = (FlightStatus.UNKNOWN, FlightStatus.ON_GROUND)

#: Time after which poses of a vehicle without a frame are taken from its topics, which costs more
#: (s).
_FRAME_TIMEOUT = 3.0

#: Types of the driver's log topics, and their numbers.
_LOGS: dict[str, tuple[Any, Callable[[Any], list[float]]]] = {
    "crazyflie_driver/GenericLogData": (GenericLogData, lambda message: list(message.values)),
    "std_msgs/Float32": (Float32, lambda message: [message.data]),
}

_LOW_BATTERY = 3.2  #: Voltage that is low if no driver reports it; that of the fleet's warning (V).


class VehicleModel:
    """A vehicle and its topics.

    Parameters
    ----------
    handle : NodeHandle
        Closed when the vehicle goes.
    vehicle : FoundVehicle
    time : callable
        The machine's time, s.
    on_row : callable
        ``on_row(role, row)`` is called with what comes on the topics of a watched vehicle.
    """

    def __init__(
        self,
        handle: NodeHandle,
        vehicle: FoundVehicle,
        time: Callable[[], float],
        on_row: Callable[[str, Any], None],
    ):
        self.vehicle = vehicle
        self.kind = Kind.REAL if vehicle.has_driver else Kind.SIMULATED
        #: Frame of /tf with its poses; without one they come from its own topics.
        self.frame: str | None = None
        self._handle, self._time, self._on_row = handle, time, on_row
        self._received: dict[str, NodeHandle] = {}
        self._since = time()
        self._rows: dict[str, Any] = {}
        self._arrivals: dict[str, float] = {}
        self._counts: Counter[str] = Counter()
        self._rates: dict[str, float] = {}
        self._counted_since = time()
        self._status = FlightStatus()
        self._filter = FilterStatus()
        self._driver: VehicleStatus | None = None
        self._text = ""
        self._battery: float | None = None
        for role in _SLOW:
            self._subscribe(handle, role)

    def receive(self, is_watched: bool, is_one_of_few: bool, topics: Mapping[str, str]) -> None:
        """Receive frequent messages only as far as they are shown.

        These are states and driver logs of a watched vehicle, and references and controls if
        vehicles are few. ``topics`` are all published topics -> type.
        """
        # Commands to a radio contain no more than the control does.
        control = "final_control" if "final_control" in self.vehicle.topics else "cmd_vel"
        wanted = {"reference", control} if is_watched or is_one_of_few else set()
        if is_watched:
            wanted |= {"state", "log"}
        if self.frame is None and self._time() - self._since > _FRAME_TIMEOUT:
            wanted.add("pose" if "pose" in self.vehicle.topics else "state")
        for role in self._received.keys() - wanted:
            self._received.pop(role).close()
            for known in (self._rows, self._arrivals, self._rates, self._counts):
                known.pop(role, None)
        for role in wanted - self._received.keys():
            handle = self._received[role] = self._handle.child()
            if role == "log":
                self._subscribe_logs(handle, topics)
            else:
                self._subscribe(handle, role)

    def close(self) -> None:
        """End all subscriptions."""
        for handle in (*self._received.values(), self._handle):
            handle.close()

    def snapshot(self, frames: Frames, fixed: str) -> VehicleSnapshot:
        """Return the present snapshot; poses are in the frame ``fixed``."""
        self._count_rates()
        position, rotation, velocity, age = self._pose(frames, fixed)
        reference = self._rows.get("reference")
        control_at = self._arrivals.get("final_control", self._arrivals.get("cmd_vel"))
        state, reason = self._words()
        driver = self._driver
        is_emergency = self._filter.state == FilterStatus.EMERGENCY or (
            driver is not None and driver.is_emergency
        )
        rates = dict(self._rates)
        if self.frame in frames.poses:
            rates["pose"] = frames.poses[self.frame].rate
        return VehicleSnapshot(
            name=self.vehicle.name,
            kind=self.kind,
            frame=self.frame,
            position=position,
            rotation=rotation,
            velocity=velocity,
            pose_age=age,
            is_stale=age is None or age > STALE_AGE,
            reference=reference and Reference(reference[:3], reference[3:6], reference[6]),
            control_age=None if control_at is None else self._time() - control_at,
            state=state,
            reason=reason,
            takeoff_refusal=self._status.takeoff_refusal or self._filter.takeoff_refusal,
            is_in_flight=self._is_in_flight(),
            is_emergency=is_emergency,
            battery=self._battery,
            is_battery_low=self._is_battery_low(),
            link_quality=None if driver is None else _known(driver.link_quality),
            rates=rates,
            actions=frozenset(self.vehicle.services),
        )

    def _subscribe(self, handle, role):
        if role not in self.vehicle.topics:
            return
        topic, kind = self.vehicle.topics[role]
        message_type = roslib.message.get_message_class(kind)
        if message_type is None:
            return
        take = getattr(self, f"_on_{role}", None)
        if take is None:
            convert = _ROWS[role][kind]

            def take(message):
                self._note(role, convert(message))

        handle.subscribe(topic, message_type, take)

    def _subscribe_logs(self, handle, topics):
        for topic, kind in topics.items():
            folder, _, name = topic.rpartition("/")
            if folder == self.vehicle.driver and kind in _LOGS and name != "battery":
                message_type, values = _LOGS[kind]
                take = partial(self._on_log, f"log {name}", values)
                handle.subscribe(topic, message_type, take)

    def _on_log(self, name, values, message):
        self._on_row(name, values(message))

    def _note(self, role, row):
        self._rows[role] = row
        self._arrivals[role] = self._time()
        self._counts[role] += 1
        self._on_row(role, row)

    def _count_rates(self):
        elapsed = self._time() - self._counted_since
        if elapsed >= 1.0:
            self._rates = {role: count / elapsed for role, count in self._counts.items()}
            self._counts = Counter(dict.fromkeys(self._counts, 0))
            self._counted_since += elapsed

    def _on_flight_status(self, message):
        self._status = message

    def _on_filter_status(self, message):
        self._filter = message

    def _on_flight_state(self, message):
        self._text = message.data

    def _on_vehicle_status(self, message):
        self._driver = message
        self._battery = _known(message.battery_voltage) or self._battery

    def _on_battery(self, message):
        self._battery = _known(message.data)
        self._note("battery", (message.data,))

    def _pose(self, frames, fixed):
        if self.frame is not None:
            found = frames.in_fixed(self.frame, fixed)
            if found is None:
                return None, (0.0, 0.0, 0.0, 1.0), None, None
            return (*found, frames.poses[self.frame].velocity, frames.age(self.frame))
        role = "pose" if self._rows.get("pose") else "state"
        row = self._rows.get(role)
        if not row:
            return None, (0.0, 0.0, 0.0, 1.0), None, None
        attitude = row[3:6] if role == "pose" else (0.0, 0.0, row[6] if row[6] == row[6] else 0.0)
        velocity = row[3:6] if role == "state" else None
        age = self._time() - self._arrivals[role]
        return row[:3], quaternion_from_rpy(*attitude), velocity, age

    def _is_in_flight(self):
        if "flight_status" in self.vehicle.topics:
            return self._status.state not in _ON_GROUND
        return self._driver is not None and bool(self._driver.supervisor & VehicleStatus.FLYING)

    def _words(self):
        """Return the state of the flight and its reason."""
        driver = self._driver
        if self._filter.state in _FILTER_WORDS and self._filter.state != FilterStatus.DOWN:
            return _FILTER_WORDS[self._filter.state], self._filter.reason
        if self._status.state != FlightStatus.UNKNOWN:
            words = WORDS[self._status.state]
            reason = self._status.reason or self._filter.reason
            # In flight a takeoff is always refused.
            if not reason and self._status.state == FlightStatus.ON_GROUND:
                reason = self._status.takeoff_refusal
            return words, reason
        if driver is not None:
            return driver.text or "connected", driver.link_text
        return self._text or "not known", ""

    def _is_battery_low(self):
        if self._driver is not None and self._driver.battery != VehicleStatus.BATTERY_UNKNOWN:
            return self._driver.battery >= VehicleStatus.BATTERY_LOW
        return self._battery is not None and self._battery < _LOW_BATTERY


def _known(number: float) -> float | None:
    return None if math.isnan(number) else number


def frame_of(vehicle: FoundVehicle, frames: Frames, is_alone: bool) -> str | None:
    """Return the frame of a vehicle: the one that has its name.

    The frame of a single vehicle may have any name: one that is away from its origin is preferred.
    """
    name = vehicle.namespace.rpartition("/")[2] or vehicle.driver.rpartition("/")[2]
    named = [each for each in frames.poses if name and name in each.split("/")]
    moving = [each for each, pose in frames.poses.items() if any(pose.stamped.position)]
    candidates = named or (moving or list(frames.poses) if is_alone else [])
    # The vehicle's own limit, not that of its model.
    return min(candidates, key=lambda each: (each.endswith("base_link"), len(each)), default=None)
