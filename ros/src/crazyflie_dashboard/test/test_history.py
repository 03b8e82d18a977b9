"""The scenes of the last ten minutes."""

import pytest
from fake_dashboard import vehicle
from fake_fleet import FakeFleet

from crazyflie_dashboard.history import SPAN, History
from crazyflie_dashboard.plots import VehiclePlots
from crazyflie_dashboard.snapshot import Scene


def filled(count, seconds, rate=20):
    history = History()
    for k in range(seconds * rate):
        vehicles = {f"cf{n}": vehicle(f"cf{n}", float(k)) for n in range(count)}
        history.add(Scene(made=k / rate, vehicles=vehicles))
    return history


def test_a_moment_of_the_last_ten_minutes_is_found():
    history = filled(1, 700, 5)
    assert history.begin == pytest.approx(700.0 - SPAN, abs=0.5)
    assert history.at(650.1).made == pytest.approx(650.0)
    assert history.at(1.0).made == history.begin
    assert History().at(1.0) is None


def test_of_many_vehicles_fewer_scenes_are_kept():
    count = {n: len(list(filled(n, 20).of("cf0"))) for n in (1, 20, 100)}
    assert count == {1: 100, 20: 100, 100: 22}


def test_a_vehicle_that_was_not_watched_has_plots_of_its_past():
    plots = VehiclePlots(lambda: 20.0)
    plots.fill(filled(1, 20).of("cf0"))
    known = {series.name: series for series in plots.series(10.0)}
    assert known["position x"].values[-1] == pytest.approx(200.0, abs=1.0)
    assert known["battery"].times[0] == pytest.approx(-10.0)
    plots.take("battery", (3.5,))
    assert plots.series()[-1].values[-1] == 3.5


def test_the_dashboard_knows_where_vehicles_were():
    fleet = FakeFleet()
    fleet.find()
    then = fleet.process.clock.time()
    fleet.send_poses(z=1.0)
    fleet.process.advance(5.0)
    fleet.send_poses(z=2.0)
    fleet.process.advance(1.0)
    assert fleet.dashboard.scene_at(then + 1.0).vehicles["cf1"].position[2] == 1.0
    assert fleet.dashboard.scene().vehicles["cf1"].position[2] == 2.0
