"""With what the diagnostics warn of a link."""

import pytest

from crazyflie_driver.driver_parameters import LinkLimits
from crazyflie_driver.status import findings
from crazyflie_msgs.msg import VehicleStatus

GOOD = {"link": VehicleStatus.CONNECTED, "link_quality": 0.95, "latency": 0.008}
COUNTS = {"num_tx_unicast": 100, "num_rx_unicast": 80}


@pytest.mark.parametrize(
    ("limits", "status", "expected"),
    [
        ({}, {"latency": 0.5, **COUNTS}, []),
        ({}, {"link_quality": 0.7}, ["poor link: 70 % of pings answered"]),
        ({"min_quality": 0.99}, {}, ["poor link: 95 % of pings answered"]),
        ({"max_latency": 0.005}, {}, ["poor link: latency 8.0 ms, expected at most 5 ms"]),
        ({"min_unicast_rate": 0.8}, COUNTS, []),
        (
            {"min_unicast_rate": 0.9},
            COUNTS,
            ["poor link: 80 of 100 unicast packets received, expected 90 %"],
        ),
        # The vehicle does not log them; or there are too few.
        ({"min_unicast_rate": 0.9}, {"num_tx_unicast": 100}, []),
        ({"min_broadcast_rate": 0.9}, {"num_tx_broadcast": 5, "num_rx_broadcast": 1}, []),
    ],
)
def test_limits(limits, status, expected):
    found = findings(VehicleStatus(**{**GOOD, **status}), LinkLimits.from_mapping(limits))
    assert [text for _, text in found] == expected
