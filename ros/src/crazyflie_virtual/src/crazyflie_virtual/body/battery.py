"""The battery: a cell that drains, and whose voltage sags under load."""

import bisect

_CAPACITY = 900.0  #: Charge of the stock battery, C: 250 mAh [Bitcraze, data sheet].
_RESISTANCE = 0.14  #: Of cell and leads, ohm: about 0.3 V of sag at hover, as vehicles log it.
_HOVER_CURRENT = 2.1  #: A: the 7 minutes of flight of the data sheet.
_IDLE_CURRENT = 0.12  #: Of the electronics, A.

_CHARGES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
#: Open-circuit voltage, V, over state of charge; the firmware's table, which is of the stock
#: battery, and 4.2 V when full.
OPEN_CIRCUIT_VOLTAGES = (3.00, 3.78, 3.83, 3.87, 3.89, 3.92, 3.96, 4.00, 4.04, 4.10, 4.20)

FULL_VOLTAGE = OPEN_CIRCUIT_VOLTAGES[-1]

#: State of charge at which the voltage in flight is low (3.2 V) but not yet critical (3.0 V).
LOW_CHARGE = 0.055


class Battery:
    """One lithium-polymer cell; ``charge`` is the state of charge, 0 to 1."""

    def __init__(self, charge: float = 1.0):
        self.charge = charge
        self.current = _IDLE_CURRENT  #: A.
        self.voltage = open_circuit_voltage(charge)  #: Under the load of the last step, V.

    def step(self, dt: float, load: float) -> None:
        """Drain for ``dt`` (s).

        ``load`` is the mean of the third powers of the rotor speeds over the hover speed's: the
        power of a rotor goes with the third power of its speed.
        """
        self.current = _IDLE_CURRENT + _HOVER_CURRENT * load
        self.charge = max(0.0, self.charge - self.current * dt / _CAPACITY)
        self.voltage = max(0.0, open_circuit_voltage(self.charge) - _RESISTANCE * self.current)


def open_circuit_voltage(charge: float) -> float:
    """Return the voltage without load, V, at a state of charge from 0 to 1."""
    i = min(max(bisect.bisect_right(_CHARGES, charge) - 1, 0), len(_CHARGES) - 2)
    part = (charge - _CHARGES[i]) / (_CHARGES[i + 1] - _CHARGES[i])
    low, high = OPEN_CIRCUIT_VOLTAGES[i : i + 2]
    return low + part * (high - low)
