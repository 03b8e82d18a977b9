"""The state of a vehicle and its link, as diagnostics."""

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from crazyflie_model.supervisor import SupervisorState
from crazyflie_py.crazyflie import LinkState

LOW_VOLTAGE, CRITICAL_VOLTAGE = 3.2, 3.0
"""Battery voltages at which the firmware warns, and shuts down after 5 s."""

LOW_QUALITY = 0.8
"""Share of answered pings below which the link is poor."""

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
    voltage : float or None
        Of the battery.
    rssi : float or None
        -dBm.
    supervisor : SupervisorState or None
    setpoint_rate : float
        Setpoints a second.
    ignored : int
        Setpoints that were not sent.
    """

    link: LinkState
    text: str
    is_emergency: bool = False
    quality: float | None = None
    latency: float | None = None
    age: float | None = None
    voltage: float | None = None
    rssi: float | None = None
    supervisor: SupervisorState | None = None
    setpoint_rate: float = 0.0
    ignored: int = 0

    def findings(self) -> list[tuple[int, str]]:
        """Return (level, text) of everything that is not as it should be, worst first."""
        found = []
        error, warn = DiagnosticStatus.ERROR, DiagnosticStatus.WARN
        if self.is_emergency:
            found.append((error, "emergency stop: remove, restart and add the vehicle"))
        if self.link in (LinkState.LOST, LinkState.DISCONNECTED):
            found.append((error, self.text))
        elif self.link is LinkState.CONNECTING:
            found.append((warn, self.text))
        if self.supervisor is not None and self.supervisor & NOT_FLYABLE:
            found.append((error, f"cannot fly: {(self.supervisor & NOT_FLYABLE).words()}"))
        if self.voltage is not None and self.voltage < CRITICAL_VOLTAGE:
            found.append((error, f"battery critical: {self.voltage:.2f} V"))
        elif self.voltage is not None and self.voltage < LOW_VOLTAGE:
            found.append((warn, f"battery low: {self.voltage:.2f} V"))
        if self.quality is not None and self.quality < LOW_QUALITY:
            found.append((warn, f"poor link: {100 * self.quality:.0f} % of pings answered"))
        return sorted(found, key=lambda finding: -finding[0])

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
            ("battery (V)", _number(self.voltage, 1.0, 2)),
            ("state", "unknown" if self.supervisor is None else self.supervisor.words()),
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
