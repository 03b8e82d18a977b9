"""Power management: states by the battery's voltage. 10 Hz."""

from crazyflie_virtual.body.battery import OPEN_CIRCUIT_VOLTAGES

ON_BATTERY, LOW = 0, 3  #: States; 1 and 2, charging and charged, do not occur.
_LOW_AFTER = 5.0  #: Time of low voltage until the state `LOW`, s.
#: Voltage, V, at 0, 10, ... 90 % of charge [firmware: measured on the stock battery at 25 C].
_LEVELS = OPEN_CIRCUIT_VOLTAGES[:-1]


class PowerMonitor:
    """Watches the voltage."""

    def __init__(self) -> None:
        self.voltage = 4.1  #: V.
        self.level = 90  #: Charge as the firmware estimates it from the voltage, %.
        self.state = ON_BATTERY  #: `ON_BATTERY` or `LOW`.
        #: low_voltage, critical_voltage: V. The second has no effect: the default build does not
        #: switch off.
        self.low_voltage, self.critical_voltage = 3.2, 3.0
        self._good_time: float | None = None

    @property
    def millivolts(self) -> float:
        """Voltage, mV."""
        return 1000.0 * self.voltage

    def update(self, time: float, voltage: float) -> None:
        """Update with the voltage (V) at a time (s)."""
        self.voltage = voltage
        self.level = 10 * min(9, sum(voltage > level for level in _LEVELS))
        if voltage > self.low_voltage or self._good_time is None:
            self._good_time = time
        self.state = LOW if time - self._good_time > _LOW_AFTER else ON_BATTERY
