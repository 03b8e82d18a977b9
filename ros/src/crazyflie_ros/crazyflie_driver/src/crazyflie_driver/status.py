"""The state of a vehicle and its link, in a sentence and as diagnostics."""

import math

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from crazyflie_driver import battery
from crazyflie_driver.server_parameters import LinkLimits
from crazyflie_model.supervisor import SupervisorState
from crazyflie_msgs.msg import VehicleStatus

_FEW_PACKETS = 10  #: Of so few packets in a second the share that is received means nothing.

_DEFAULTS = LinkLimits.from_mapping({})

LINK_NAMES = {
    VehicleStatus.DISCONNECTED: "disconnected",
    VehicleStatus.CONNECTING: "connecting",
    VehicleStatus.CONNECTED: "connected",
    VehicleStatus.LOST: "lost",
}

_EMERGENCY = "emergency stop: remove, restart and add the vehicle"
_BLOCKED = "setpoints are ignored since the link was lost: pause them, or call a service"


def findings(status: VehicleStatus, limits: LinkLimits = _DEFAULTS) -> list[tuple[int, str]]:
    """Return (level, text) of everything that is not as it should be, worst first."""
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
        charge = battery.Charge(status.battery)
        found.append((level, battery.words(charge, status.battery_voltage)))
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
    """Return what state a vehicle is in and why, such as "flying: on setpoints"."""
    state = SupervisorState(status.supervisor)
    if status.is_emergency:
        return _EMERGENCY
    if status.link != VehicleStatus.CONNECTED:
        return f"{LINK_NAMES[status.link]}: {status.link_text}"
    if state.faults:
        text = f"cannot fly: {state.faults.words()}; restart the vehicle"
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
        reasons.append(f"battery {battery.Charge(status.battery).name.lower()}")
    if status.is_link_poor:
        reasons.append("poor link")
    if status.restarts:
        reasons.append(f"has restarted {status.restarts} times since it was added")
    return "; ".join(reasons)


def diagnostics(
    status: VehicleStatus, name: str, hardware_id: str, limits: LinkLimits = _DEFAULTS
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
