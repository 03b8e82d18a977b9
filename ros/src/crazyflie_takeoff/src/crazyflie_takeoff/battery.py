"""What a battery's voltage means for a flight."""

import enum
import math


class Charge(enum.Enum):
    """How much is left."""

    UNKNOWN = enum.auto()
    GOOD = enum.auto()
    LOW = enum.auto()
    CRITICAL = enum.auto()


MAX_VOLTAGE_AGE = 5.0  #: A voltage that is older does not count, s; the driver sends one a second.
_LONGEST_STEP = 1.5  #: Voltages that are further apart count as this far, s.
_NOT_LOWER = -math.inf  #: How long a voltage has been lower that is not, s.


class Battery:
    """The charge of a battery, by how long its voltage has been below two levels (V).

    In flight a voltage sags with every burst of thrust; so it has to stay low for ``duration`` (s);
    with 0 a single low voltage is enough.
    """

    def __init__(self, low: float, critical: float, duration: float):
        self._levels = (critical, low)
        self._duration = duration
        self._lasted = [_NOT_LOWER, _NOT_LOWER]
        self.voltage = math.nan
        self._time = math.inf  # s; infinite before the first voltage.

    def measure(self, time: float, voltage: float) -> None:
        """Take a voltage (V) that was measured at ``time`` (s)."""
        step = min(max(time - self._time, 0.0), _LONGEST_STEP)
        self._lasted = [
            max(lasted + step, 0.0) if voltage < level else _NOT_LOWER
            for lasted, level in zip(self._lasted, self._levels, strict=True)
        ]
        self.voltage, self._time = voltage, time

    def charge(self, time: float) -> Charge:
        """Return what is left at ``time`` (s)."""
        if not abs(time - self._time) < MAX_VOLTAGE_AGE:
            return Charge.UNKNOWN
        critical, low = (lasted >= self._duration for lasted in self._lasted)
        if critical:
            return Charge.CRITICAL
        return Charge.LOW if low else Charge.GOOD
