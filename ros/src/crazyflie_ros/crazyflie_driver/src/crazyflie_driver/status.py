"""The state of a vehicle and its link: as topics, in a sentence and as diagnostics."""

import contextlib
import math
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from std_msgs.msg import Bool, Header, String

from crazyflie_driver.driver_parameters import (
    CONNECTED_TOPIC,
    STATUS_TOPIC,
    VEHICLE_STATUS_TOPIC,
    LinkLimits,
)
from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.monitors import Charge, battery_words
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.vehicle_base import BaseVehicle
from crazyflie_link.crazyflie import LinkState
from crazyflie_link.errors import LinkLostError
from crazyflie_model.supervisor import SupervisorState
from crazyflie_msgs.msg import VehicleStatus

#: Least number of packets in a second for a meaningful fraction of received ones.
_FEW_PACKETS = 10

#: VehicleStatus.link -> its name.
LINK_NAMES = {getattr(VehicleStatus, state.name): state.value for state in LinkState}

_EMERGENCY = "emergency stop: remove, restart and add the vehicle"
_BLOCKED = (
    "setpoints are ignored since the link was lost, or the vehicle was added: pause them, or send "
    "zero thrust"
)


def findings(status: VehicleStatus, limits: LinkLimits) -> list[tuple[int, str]]:
    """Return (level, text) of all faults, worst first."""
    found = []
    error, warn = DiagnosticStatus.ERROR, DiagnosticStatus.WARN
    if status.is_emergency:
        found.append((error, _EMERGENCY))
    if status.link != VehicleStatus.CONNECTED:
        level = warn if status.link == VehicleStatus.CONNECTING else error
        found.append((level, status.link_text))
    faults = SupervisorState(status.supervisor).faults
    if faults:
        found.append((error, f"cannot fly: {faults.words()}"))
    if status.battery >= VehicleStatus.BATTERY_LOW:
        level = error if status.battery == VehicleStatus.BATTERY_CRITICAL else warn
        text = battery_words(Charge(status.battery), status.battery_voltage)
        found.append((level, text))
    if status.link == VehicleStatus.CONNECTED and status.are_setpoints_blocked:
        found.append((warn, _BLOCKED))
    found += [(warn, f"poor link: {text}") for text in _link_faults(status, limits)]
    return sorted(found, key=lambda finding: -finding[0])


def _link_faults(status, limits):
    if status.is_link_poor or status.link_quality < limits.min_quality:
        answered = 0.0 if math.isnan(status.link_quality) else 100.0 * status.link_quality
        yield f"{answered:.0f} % of pings answered"
    if limits.max_latency is not None and status.latency > limits.max_latency:
        yield (
            f"latency {1000.0 * status.latency:.1f} ms, expected at most "
            f"{1000.0 * limits.max_latency:g} ms"
        )
    counts = {
        "unicast": (status.num_rx_unicast, status.num_tx_unicast, limits.min_unicast_rate),
        "broadcast": (status.num_rx_broadcast, status.num_tx_broadcast, limits.min_broadcast_rate),
    }
    for kind, (received, sent, limit) in counts.items():
        # None received: it is not logged.
        if sent >= _FEW_PACKETS and 0 < received < limit * sent:
            yield f"{received} of {sent} {kind} packets received, expected {100.0 * limit:g} %"


def words(status: VehicleStatus) -> str:
    """Return the state of a vehicle and its reason, such as "flying: on setpoints"."""
    state = SupervisorState(status.supervisor)
    if status.is_emergency:
        return _EMERGENCY
    if status.link != VehicleStatus.CONNECTED:
        return f"{LINK_NAMES[status.link]}: {status.link_text}"
    if state.faults:
        text = f"cannot fly: {state.faults.words()}; {state.remedy}"
    elif SupervisorState.FLYING in state:
        text = "flying: on " + ("setpoints" if status.is_streamed else "high-level commands")
    elif not status.has_supervisor:
        text = "connected: the vehicle's own state is unknown"
    else:
        text = "ready: armed" if SupervisorState.ARMED in state else "ready: not armed"
    reasons = [text]
    if status.are_setpoints_blocked:
        reasons.append(_BLOCKED)
    if status.battery >= VehicleStatus.BATTERY_LOW:
        reasons.append(f"battery {Charge(status.battery).name.lower()}")
    if status.is_link_poor:
        reasons.append("poor link")
    if status.restarts:
        reasons.append(f"has restarted {status.restarts} times since it was added")
    return "; ".join(reasons)


def diagnostics(
    status: VehicleStatus, name: str, hardware_id: str, limits: LinkLimits
) -> DiagnosticStatus:
    """Return a status as diagnostic_msgs/DiagnosticStatus."""
    found = findings(status, limits)
    level, text = found[0] if found else (DiagnosticStatus.OK, "connected")
    state = SupervisorState(status.supervisor).words() if status.has_supervisor else "unknown"
    rows = [
        ("link", LINK_NAMES[status.link]),
        ("link quality (%)", _number(status.link_quality, 100.0, 0)),
        ("latency (ms)", _number(status.latency, 1000.0, 1)),
        ("last heard (ms ago)", _number(status.last_heard, 1000.0, 0)),
        ("rssi (-dBm)", _number(status.rssi, 1.0, 0)),
        ("battery (V)", _number(status.battery_voltage, 1.0, 2)),
        ("state", state),
        ("restarts", str(status.restarts)),
        ("emergency stop", str(status.is_emergency)),
        ("setpoints (Hz)", f"{status.setpoint_rate:.0f}"),
        ("setpoints ignored", str(status.setpoints_ignored)),
        ("findings", "; ".join(each for _, each in found) or "none"),
    ]
    return DiagnosticStatus(
        level=level,
        name=name,
        hardware_id=hardware_id,
        message=text,
        values=[KeyValue(key, value) for key, value in rows],
    )


def _number(value, factor, digits):
    return "unknown" if math.isnan(value) else f"{factor * value:.{digits}f}"


PERIOD = 1.0  #: Period at which both are repeated, s: their absence shows that the driver is gone.

#: Fields of which a change is published at once.
_STATES = ("text", "link", "supervisor", "has_supervisor", "is_emergency", "battery", "is_streamed")
#: Largest number of packets in a second. The vehicle's counters have 16 bits; a larger difference
#: is a restart.
_MOST = 1 << 15


@dataclass(eq=False)
class StatusPublisher:
    """Publish the status of a vehicle, in words and typed, and whether it is connected."""

    _vehicle: BaseVehicle
    _log: LogTopics
    _setpoints: SetpointTopics
    radio: Any = None  #: Sender to all vehicles of its channel; see `radio_channel`.
    # Counts of received and sent broadcasts, received and sent unicasts; and in the last period.
    _counts: tuple[int, ...] = (0, 0, 0, 0)
    _in_period: tuple[int, ...] = (0, 0, 0, 0)
    _published: VehicleStatus | None = None
    _is_connected: bool = False

    def __post_init__(self) -> None:
        vehicle = self._vehicle
        self._text = vehicle.publisher(STATUS_TOPIC, String, latch=True)
        self._typed = vehicle.publisher(VEHICLE_STATUS_TOPIC, VehicleStatus, latch=True)
        self._connected = vehicle.publisher(CONNECTED_TOPIC, Bool, latch=True)
        self._connected.publish(Bool(False))
        vehicle.handle.timer(PERIOD, self._repeat)

    def status(self) -> VehicleStatus:
        """Return the present status of the vehicle."""
        vehicle, battery = self._vehicle, self._log.battery
        crazyflie, state = vehicle.crazyflie, self._log.supervisor
        message = VehicleStatus(
            header=Header(stamp=vehicle.handle.stamp()),
            link=getattr(VehicleStatus, crazyflie.state.name),
            link_text=vehicle.link_text,
            supervisor=int(state or 0),
            has_supervisor=state is not None,
            is_emergency=vehicle.gate.is_emergency,
            battery=int(battery.charge),
            battery_voltage=_or_nan(battery.voltage),
            link_quality=math.nan,
            latency=math.nan,
            last_heard=math.nan,
            rssi=_or_nan(self._log.rssi),
            is_streamed=self._setpoints.is_streaming,
            setpoint_rate=self._setpoints.rate(),
            setpoints_ignored=self._setpoints.ignored,
            are_setpoints_blocked=vehicle.gate.is_blocking(vehicle.handle.time()),
            restarts=crazyflie.restarts,
            pm_state=self._log.power_state,
            supervisor_info=int(state or 0),
        )
        (
            message.num_rx_broadcast,
            message.num_tx_broadcast,
            message.num_rx_unicast,
            message.num_tx_unicast,
        ) = self._in_period
        # Without a link there are no figures.
        with contextlib.suppress(LinkLostError):
            message.link_quality = crazyflie.quality()
            message.is_link_poor = crazyflie.is_poor()
            message.latency = crazyflie.latency()
            message.latency_unicast = _milliseconds(message.latency)
            message.last_heard = crazyflie.age()
        message.text = words(message)
        return message

    def publish(self) -> None:
        """Publish the status if it has changed."""
        message = self.status()
        before, self._published = self._published, message
        if any(getattr(message, name) != getattr(before, name, None) for name in _STATES):
            self._typed.publish(message)
        if before is None or message.text != before.text:
            self._text.publish(String(message.text))
        is_connected = message.link == VehicleStatus.CONNECTED and self._vehicle.is_ready()
        if is_connected != self._is_connected:
            self._is_connected = is_connected
            self._connected.publish(Bool(is_connected))

    def _count_packets(self):
        log = self._log
        sent = 0 if self.radio is None else self.radio.sent
        counts = (
            log.received_broadcasts,
            sent,
            log.received_unicasts,
            self._vehicle.crazyflie.sent,
        )
        new = [(now - before) & 0xFFFF for now, before in zip(counts, self._counts, strict=True)]
        self._counts = counts
        self._in_period = tuple(count if count < _MOST else 0 for count in new)

    def _repeat(self):
        self._count_packets()
        self._typed.publish(self.status())
        self._connected.publish(Bool(self._is_connected))


def _or_nan(value):
    return math.nan if value is None else value


def _milliseconds(latency):
    return min(round(1000.0 * latency), 0xFFFF) if math.isfinite(latency) else 0
