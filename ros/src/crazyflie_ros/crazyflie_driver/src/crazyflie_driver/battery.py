"""What the voltage of a battery means for the flight."""

import enum


class Charge(enum.IntEnum):
    """How much is left."""

    UNKNOWN = -1
    GOOD = 0
    LOW = 1
    CRITICAL = 2


class Battery:
    """Judge voltages as they come.

    Parameters
    ----------
    low, critical : float
        Voltages, V.
    critical_time : float
        How long the voltage has to be below the critical one, s: it sinks under load.
    """

    def __init__(self, low: float, critical: float, critical_time: float):
        self._low, self._critical, self._time = low, critical, critical_time
        self._critical_since: float | None = None
        self.voltage: float | None = None
        self.charge = Charge.UNKNOWN

    def update(self, voltage: float, now: float) -> Charge:
        """Take note of a voltage (V) at a moment (s); return what it means."""
        self.voltage = voltage
        if not voltage < self._critical:
            self._critical_since = None
        elif self._critical_since is None:
            self._critical_since = now
        since = self._critical_since
        if since is not None and now - since >= self._time:
            self.charge = Charge.CRITICAL
        elif voltage < self._low:
            self.charge = Charge.LOW
        else:
            self.charge = Charge.GOOD
        return self.charge

    def words(self) -> str:
        """Return the state, such as "battery low: 3.12 V"; empty if nothing is wrong."""
        if self.charge is Charge.CRITICAL:
            return f"battery critical: {self.voltage:.2f} V"
        return f"battery low: {self.voltage:.2f} V" if self.charge is Charge.LOW else ""
