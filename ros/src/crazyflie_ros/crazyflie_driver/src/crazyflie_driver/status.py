"""The state of a vehicle and its link, as diagnostics and in a sentence."""

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from crazyflie_driver.battery import Battery, Charge
from crazyflie_link.crazyflie import LinkState
from crazyflie_model.supervisor import SupervisorState

LOW_QUALITY = 0.8
"""Share of answered pings below which the link is poor."""

EMERGENCY = "emergency stop: remove, restart and add the vehicle"
WAITING = "setpoints are ignored since the link was lost: pause them, or call a service"

NOT_FLYABLE = SupervisorState.TUMBLED | SupervisorState.LOCKED | SupervisorState.CRASHED
"""States in which a vehicle cannot take off."""


@dataclass(frozen=True)
class Status:
    """What is known of a vehicle at a moment.

    Attributes
    ----------
    link : LinkState
    text : str
        Why the link is in this state.
    is_emergency : bool
        Whether the emergency stop is latched.
    quality : float or None
        Share of answered pings, 0 to 1.
    latency, age : float or None
        Of pings, and of the last sign of life, s.
    is_poor : bool
        Whether hardly any of the latest pings were answered.
    battery : Battery or None
    rssi : float or None
        -dBm.
    supervisor : SupervisorState or None
    setpoint_rate : float
        Setpoints a second.
    ignored : int
        Setpoints that were not sent.
    is_waiting : bool
        Whether setpoints are blocked since the link was lost.
    is_high_level : bool
        Whether the vehicle takes high-level commands, no setpoints.
    restarts : int
        How many times the vehicle was seen to restart.
    """

    link: LinkState
    text: str
    is_emergency: bool = False
    quality: float | None = None
    latency: float | None = None
    age: float | None = None
    is_poor: bool = False
    battery: Battery | None = None
    rssi: float | None = None
    supervisor: SupervisorState | None = None
    setpoint_rate: float = 0.0
    ignored: int = 0
    is_waiting: bool = False
    is_high_level: bool = True
    restarts: int = 0

    def findings(self) -> list[tuple[int, str]]:
        """Return (level, text) of everything that is not as it should be, worst first."""
        found = []
        error, warn = DiagnosticStatus.ERROR, DiagnosticStatus.WARN
        if self.is_emergency:
            found.append((error, EMERGENCY))
        if self.link in (LinkState.LOST, LinkState.DISCONNECTED):
            found.append((error, self.text))
        elif self.link is LinkState.CONNECTING:
            found.append((warn, self.text))
        if self.supervisor is not None and self.supervisor & NOT_FLYABLE:
            found.append((error, f"cannot fly: {(self.supervisor & NOT_FLYABLE).words()}"))
        if self.battery is not None and self.battery.charge >= Charge.LOW:
            level = error if self.battery.charge is Charge.CRITICAL else warn
            found.append((level, self.battery.words()))
        if self.link is LinkState.CONNECTED and self.is_waiting:
            found.append((warn, WAITING))
        if self.is_poor or (self.quality is not None and self.quality < LOW_QUALITY):
            found.append((warn, f"poor link: {100 * (self.quality or 0):.0f} % of pings answered"))
        return sorted(found, key=lambda finding: -finding[0])

    def words(self) -> str:
        """Return what state the vehicle is in and why, such as "flying: on setpoints"."""
        state = self.supervisor or SupervisorState(0)
        reasons = [WAITING] if self.is_waiting else []
        if self.is_emergency:
            return f"emergency stop: {EMERGENCY.partition(': ')[2]}"
        if self.link is not LinkState.CONNECTED:
            return f"{self.link.value}: {self.text}"
        if state & NOT_FLYABLE:
            words = f"cannot fly: {(state & NOT_FLYABLE).words()}; restart the vehicle"
        elif SupervisorState.FLYING in state:
            words = "flying: on " + ("high-level commands" if self.is_high_level else "setpoints")
        elif self.supervisor is None:
            words = "connected: the vehicle's own state is unknown"
        elif SupervisorState.ARMED in state:
            words = "ready: armed"
        else:
            words = "ready: not armed"
        if self.battery is not None and self.battery.charge >= Charge.LOW:
            reasons.append(f"battery {self.battery.charge.name.lower()}")
        if self.is_poor:
            reasons.append("poor link")
        if self.restarts:
            reasons.append(f"has restarted {self.restarts} times since it was added")
        return "; ".join([words, *reasons])

    def message(self, name: str, hardware_id: str) -> DiagnosticStatus:
        """Return the status as diagnostic_msgs/DiagnosticStatus."""
        found = self.findings()
        level, text = found[0] if found else (DiagnosticStatus.OK, "connected")
        rows = [
            ("link", self.link.value),
            ("link quality (%)", _number(self.quality, 100.0, 0)),
            ("latency (ms)", _number(self.latency, 1000.0, 1)),
            ("last heard (ms ago)", _number(self.age, 1000.0, 0)),
            ("rssi (-dBm)", _number(self.rssi, 1.0, 0)),
            ("battery (V)", _number(self.battery and self.battery.voltage, 1.0, 2)),
            ("state", "unknown" if self.supervisor is None else self.supervisor.words()),
            ("restarts", str(self.restarts)),
            ("emergency stop", str(self.is_emergency)),
            ("setpoints (Hz)", f"{self.setpoint_rate:.0f}"),
            ("setpoints ignored", str(self.ignored)),
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
    return "unknown" if value is None else f"{factor * value:.{digits}f}"
