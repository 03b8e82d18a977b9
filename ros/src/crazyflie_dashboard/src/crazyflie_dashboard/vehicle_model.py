"""A vehicle and its topics, which become a `VehicleSnapshot`."""

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import roslib.message

from crazyflie_dashboard.discovery import FoundVehicle
from crazyflie_dashboard.frames import Frames
from crazyflie_dashboard.plots import VehiclePlots
from crazyflie_dashboard.snapshot import STALE_AGE, Kind, VehicleSnapshot
from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_msgs.msg import FilterStatus, FlightStatus, VehicleStatus
from crazyflie_reports.bag_topics import ROLES
from crazyflie_utils import NodeHandle
from crazyflie_utils.flight_status import WORDS

#: Role -> type -> function that returns the row of a message.
_ROWS: dict[str, dict[str, Callable[[Any], Any]]] = defaultdict(dict)
for _role in ROLES:
    _ROWS[_role.name].update(_role.rows)

#: Types of the driver's log topics -> function that returns their numbers.
_LOGS: dict[str, Callable[[Any], Any]] = {
    "crazyflie_driver/GenericLogData": lambda message: message.values,
    "std_msgs/Float32": lambda message: (message.data,),
}

#: Roles that are always received, and what holds before their first message.
_UNHEARD: dict[str, Any] = {
    "flight_status": FlightStatus(),
    "filter_status": FilterStatus(),
    "vehicle_status": VehicleStatus(link_quality=math.nan),
    "battery": (math.nan,),
}

_FILTER_WORDS = {
    FilterStatus.HOLDING: "held by the filter",
    FilterStatus.SINKING: "brought down by the filter",
    FilterStatus.EMERGENCY: "emergency, motors off",
}
_ON_GROUND = (FlightStatus.UNKNOWN, FlightStatus.ON_GROUND)

#: Time after which poses of a vehicle without a frame are taken from its topics, which costs more
#: (s).
_FRAME_TIMEOUT = 3.0
_NO_POSE = (None, (0.0, 0.0, 0.0, 1.0), None, None)

_LOW_BATTERY = 3.2  #: Voltage that is low if no driver reports it; that of the fleet's warning (V).


class VehicleModel:
    """A vehicle and its topics.

    The handle is closed when the vehicle goes; ``time()`` is the machine's (s); ``plots`` has what
    has been plotted of it until now.
    """

    def __init__(
        self,
        handle: NodeHandle,
        vehicle: FoundVehicle,
        time: Callable[[], float],
        plots: VehiclePlots | None = None,
    ):
        self.vehicle = vehicle
        self.now = VehicleSnapshot(vehicle.name)  #: The one in the newest scene.
        self.kind = Kind.REAL if vehicle.has_driver else Kind.SIMULATED
        #: Frame of /tf with its poses; without one they come from its own topics.
        self.frame: str | None = None
        self.seen = time()  #: When its topics were last on the graph (s).
        self.plots = plots  #: None while no page watches it.
        self._handle, self._time = handle, time
        self._received: dict[str, NodeHandle] = {}
        self._since = self._counted_since = time()
        #: By role: the newest row, or message where a role has no rows, and its time (s).
        self._newest = dict(_UNHEARD)
        self._arrivals: dict[str, float] = {}
        self._counts: Counter[str] = Counter()
        self._rates: dict[str, float] = {}
        for role in _UNHEARD:
            self._subscribe(handle, role)

    def receive(self, is_watched: bool, is_one_of_few: bool, topics: Mapping[str, str]) -> None:
        """Receive frequent messages only as far as they are shown.

        These are states and driver logs of a watched vehicle, and references and controls if
        vehicles are few. ``topics`` are all published topics -> type.
        """
        self.plots = (self.plots or VehiclePlots(self._time)) if is_watched else None
        # Commands to a radio contain no more than the control does.
        control = "final_control" if "final_control" in self.vehicle.topics else "cmd_vel"
        wanted = {"reference", control} if is_watched or is_one_of_few else set()
        if is_watched:
            wanted |= {"state", "log"}
        if self.frame is None and self._time() - self._since > _FRAME_TIMEOUT:
            wanted.add("pose" if "pose" in self.vehicle.topics else "state")
        for role in self._received.keys() - wanted:
            self._received.pop(role).close()
            for known in (self._newest, self._arrivals, self._rates, self._counts):
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
        reference = self._newest.get("reference")
        control_at = self._arrivals.get("final_control", self._arrivals.get("cmd_vel"))
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
            reference=reference and reference[:3],
            control_age=None if control_at is None else self._time() - control_at,
            rates=rates,
            actions=self.vehicle.actions,
            **self._reported,
        )

    @cached_property
    def _reported(self) -> dict[str, Any]:
        """Return what only the messages of `_UNHEARD` say."""
        flight, held, driver, (volts,) = (self._newest[role] for role in _UNHEARD)
        state, reason = self._words(flight, held, driver)
        is_flying = bool(driver.supervisor & VehicleStatus.FLYING)
        if "flight_status" in self.vehicle.topics:
            is_flying = flight.state not in _ON_GROUND
        battery = _known(volts)
        is_low = battery is not None and battery < _LOW_BATTERY
        if driver.battery != VehicleStatus.BATTERY_UNKNOWN:
            is_low = driver.battery >= VehicleStatus.BATTERY_LOW
        return {
            "state": state,
            "reason": reason,
            "takeoff_refusal": flight.takeoff_refusal or held.takeoff_refusal,
            "is_in_flight": is_flying,
            "is_emergency": held.state == FilterStatus.EMERGENCY or driver.is_emergency,
            "battery": battery,
            "is_battery_low": is_low,
            "link_quality": _known(driver.link_quality),
        }

    def _subscribe(self, handle, role):
        if role not in self.vehicle.topics:
            return
        topic, kind = self.vehicle.topics[role]
        convert = _ROWS[role].get(kind, lambda message: message)
        if message_type := roslib.message.get_message_class(kind):
            handle.subscribe(topic, message_type, lambda m: self._note(role, convert(m)))

    def _subscribe_logs(self, handle, topics):
        for topic, kind in topics.items():
            folder, _, name = topic.rpartition("/")
            if folder == self.vehicle.driver and kind in _LOGS and name != "battery":
                handle.subscribe(
                    topic,
                    roslib.message.get_message_class(kind),
                    lambda m, name=f"log {name}", row=_LOGS[kind]: self._plot(name, row(m)),
                )

    def _note(self, role, content):
        self._newest[role] = content
        self.__dict__.pop("_reported", None)
        # A voltage that was known stays until there is another one; 0 V is not a measurement.
        if role == "vehicle_status" and _known(content.battery_voltage):
            self._newest["battery"] = (content.battery_voltage,)
        self._arrivals[role] = self._time()
        self._counts[role] += 1
        self._plot(role, content)

    def _plot(self, role, row):
        if self.plots is not None:
            self.plots.take(role, row)

    def _count_rates(self):
        elapsed = self._time() - self._counted_since
        if elapsed >= 1.0:
            self._rates = {role: count / elapsed for role, count in self._counts.items()}
            self._counts = Counter(dict.fromkeys(self._counts, 0))
            self._counted_since += elapsed

    def _pose(self, frames, fixed):
        """Return position, rotation, velocity and age, of the frame or of a topic."""
        if self.frame is not None:
            found = frames.in_fixed(self.frame, fixed)
            if found is None:
                return _NO_POSE
            return (*found, frames.poses[self.frame].velocity, frames.age(self.frame))
        role = "pose" if self._newest.get("pose") else "state"
        row = self._newest.get(role)
        if not row:
            return _NO_POSE
        attitude = row[3:6] if role == "pose" else (0.0, 0.0, row[6] if row[6] == row[6] else 0.0)
        velocity = row[3:6] if role == "state" else None
        age = self._time() - self._arrivals[role]
        return row[:3], quaternion_from_rpy(*attitude), velocity, age

    def _words(self, flight, held, driver):
        """Return the state of the flight and its reason."""
        if held.state in _FILTER_WORDS:
            return _FILTER_WORDS[held.state], held.reason
        if flight.state != FlightStatus.UNKNOWN:
            # In flight a takeoff is always refused.
            is_down = flight.state == FlightStatus.ON_GROUND
            reason = flight.reason or held.reason or (flight.takeoff_refusal if is_down else "")
            return WORDS[flight.state], reason
        if "vehicle_status" in self._arrivals:
            return driver.text or "connected", driver.link_text
        return "not known", ""


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
