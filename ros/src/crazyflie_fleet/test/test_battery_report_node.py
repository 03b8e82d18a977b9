"""Voltages of a fleet file that are only reported."""

from std_msgs.msg import Float32

from crazyflie_fleet import fleet_file
from crazyflie_fleet.connect_node import BatteryReportNode
from crazyflie_utils.testing import FakeProcess

FLEET = fleet_file.parse(
    "robots: {a: {initial_position: [0, 0, 0]}, "
    "b: {initial_position: [1, 0, 0], battery: {act: true}}}\n"
    "all: {battery: {voltage_warning: 3.8, voltage_critical: 3.7}}"
)


def test_low_voltages_are_logged():
    process = FakeProcess()
    assert process.launch(BatteryReportNode(FLEET.vehicles), "/report")
    text = "/report: a: the battery has {} V; voltage_{} of the fleet file is {} V"
    warning, critical = text.format("3.75", "warning", 3.8), text.format("3.60", "critical", 3.7)
    for voltage, expected in (
        (3.9, []),
        (3.75, [warning]),
        (3.6, [warning, critical]),
        (float("nan"), [warning, critical]),
    ):
        process.publish("/a/battery", Float32(voltage))
        assert process.logged("warn") == expected
