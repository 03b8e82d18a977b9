"""The software example holds its hover on vehicles that differ from their model."""

import fleet
import numpy as np
import pytest

from crazyflie_reports.flight_record import FlightReport

HOVER = (0.0, 0.0, 1.0)
TOLERANCE = 0.02
# mass over thrust of the vehicle, both relative to the model
VEHICLES = {
    "light_weak": 0.9 / 0.9,
    "light_strong": 0.9 / 1.1,
    "heavy_weak": 1.1 / 0.9,
    "heavy_strong": 1.1 / 1.1,
}


@pytest.fixture(scope="module")
def records():
    """Fly all of them at once."""
    return fleet.fly(list(VEHICLES), hover=15.0)


@pytest.mark.parametrize("name", VEHICLES)
def test_hover_holds(records, name):
    report = FlightReport.of(records[name], HOVER)
    print(report.table())
    assert report.hover_error_max < TOLERANCE


@pytest.mark.parametrize("name", VEHICLES)
def test_vehicle_is_what_it_should_be(records, name):
    events = records[name].events
    thrusts = records[name].final_control.between(events["land"] - 5.0, events["land"])[:, 3]
    assert np.mean(thrusts) == pytest.approx(9.81 * VEHICLES[name], rel=0.01)
