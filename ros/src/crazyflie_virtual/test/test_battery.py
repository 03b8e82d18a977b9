"""Battery and power management."""

import pytest

from crazyflie_virtual.body import LOW_CHARGE, Battery, open_circuit_voltage
from crazyflie_virtual.firmware.supervisor import LOW, ON_BATTERY, PowerMonitor


def drained(battery, duration, load, dt=0.1):
    for _ in range(round(duration / dt)):
        battery.step(dt, load)
    return battery


def test_hover_lasts_as_long_as_the_data_sheet_says():
    assert 0.0 < drained(Battery(), 6.0 * 60.0, load=1.0).charge < 0.15


def test_idling_takes_hours():
    assert drained(Battery(), 600.0, load=0.0).charge > 0.9


def test_charge_that_is_taken_is_current_times_time():
    battery = drained(Battery(), 60.0, load=1.0)
    assert 1.0 - battery.charge == pytest.approx(battery.current * 60.0 / 900.0)


def test_voltage_sags_under_load_and_comes_back():
    battery = Battery(0.5)
    idle = drained(battery, 0.1, load=0.0).voltage
    flying = drained(battery, 0.1, load=1.0).voltage
    assert 0.2 < idle - flying < 0.4
    assert drained(battery, 0.1, load=0.0).voltage == pytest.approx(idle, abs=0.01)


def test_open_circuit_voltage_is_monotonic():
    voltages = [open_circuit_voltage(i / 100.0) for i in range(101)]
    assert voltages == sorted(voltages)
    assert (voltages[0], voltages[-1]) == (3.0, 4.2)


def test_low_charge_is_low_in_flight_and_not_critical():
    voltage = drained(Battery(LOW_CHARGE), 0.1, load=1.0).voltage
    assert 3.0 < voltage < 3.2


def test_battery_never_has_less_than_nothing():
    battery = drained(Battery(0.0), 10.0, load=30.0)
    assert battery.charge == 0.0
    assert battery.voltage == 0.0


def test_monitor_says_low_after_five_seconds():
    monitor = PowerMonitor()
    for k in range(100):
        monitor.update(0.1 * k, 3.1 if k >= 20 else 4.0)
        assert monitor.state == (LOW if k > 69 else ON_BATTERY)
    monitor.update(10.0, 3.3)
    assert monitor.state == ON_BATTERY


@pytest.mark.parametrize(
    ("voltage", "level"), [(2.9, 0), (3.5, 10), (3.8, 20), (3.93, 60), (4.2, 90)]
)
def test_level_is_guessed_from_the_voltage(voltage, level):
    monitor = PowerMonitor()
    monitor.update(0.0, voltage)
    assert monitor.level == level
