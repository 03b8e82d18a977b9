"""Charge of a battery by its voltage."""

import enum


class Charge(enum.IntEnum):
    """Charge of a battery; the numbers are those of crazyflie_msgs/VehicleStatus."""

    UNKNOWN = 0
    GOOD = 1
    LOW = 2
    CRITICAL = 3


class Battery:
    """Classify voltages by limits in V.

    The charge is critical after a time (s) below its limit, since the voltage sinks under load; and
    as that comes back with less load, it is so until the voltage is no longer low.
    """

    def __init__(self, low: float, critical: float, critical_time: float):
        self._low, self._critical, self._time = low, critical, critical_time
        self._critical_since: float | None = None
        self.voltage: float | None = None
        self.charge = Charge.UNKNOWN

    def update(self, voltage: float, now: float) -> Charge:
        """Return the charge after a voltage (V) at a time (s)."""
        self.voltage = voltage
        if not voltage < self._critical:
            self._critical_since = None
        elif self._critical_since is None:
            self._critical_since = now
        since = self._critical_since
        is_low = voltage < self._low
        if since is not None and now - since >= self._time:
            self.charge = Charge.CRITICAL
        elif is_low and self.charge is not Charge.CRITICAL:
            self.charge = Charge.LOW
        elif not is_low:
            self.charge = Charge.GOOD
        return self.charge

    def words(self) -> str:
        """Return the state, such as "battery low: 3.12 V"; empty if nothing is wrong."""
        return "" if self.voltage is None else words(self.charge, self.voltage)


def words(charge: Charge, voltage: float) -> str:
    """Return a state, such as "battery low: 3.12 V"; empty if nothing is wrong."""
    if charge == Charge.CRITICAL:
        return f"battery critical: {voltage:.2f} V"
    return f"battery low: {voltage:.2f} V" if charge == Charge.LOW else ""
