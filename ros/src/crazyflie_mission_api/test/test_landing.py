"""Missions land vehicles that are above each other, whatever ends the mission."""

import math

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from simulated import Swarm

from crazyflie_mission_api import Bounds, DryRun, MissionError
from crazyflie_mission_api.dry_run import dry_run
from crazyflie_mission_api.group_state import Rules

ROW = {f"cf{k}": (float(k), 0.0, 0.0) for k in range(4)}
TOWER = {"cf0": (0.0, 0.0, 1.0), "cf1": (0.0, 0.0, 2.0), "cf2": (0.0, 0.0, 3.0), "cf3": (3.0, 0, 1)}


def to_the_tower(group):
    """Fly three vehicles above each other; one stays next to them."""
    group.takeoff(1.0)
    for height in (2.0, 3.0):
        name = f"cf{height - 1:.0f}"
        x, y, _ = group.position(name)
        group[name].go_to((x, y, height))
        group[name].go_to((0.0, 0.0, height))


@pytest.fixture
def tower():
    """Return a dry_run of vehicles above each other."""
    group = DryRun(ROW)
    to_the_tower(group)
    return group


def places(group):
    return np.array([group.position(name) for name in group.names])


def watch(group):
    """Return a list of the least distances of vehicles, m, from now on."""
    found, clock = [], group.clock
    wait_until = clock.wait_until

    def look(condition, deadline):
        def watched():
            at = places(group)
            if at[:, 2].max() > 0.0:
                found.append(pdist(at * (1.0, 1.0, 0.5)).min())
            return condition()

        return wait_until(watched, deadline)

    clock.wait_until = look
    return found


def test_vehicles_above_each_other_land_beside_each_other(tower):
    found = watch(tower)
    tower.land()
    assert tower.flying == []
    assert places(tower)[:, 2] == pytest.approx(0.0)
    assert min(found) >= 0.3
    # The lowest one, and one with no vehicle beneath it, come straight down.
    assert tower.position("cf0") == pytest.approx((0.0, 0.0, 0.0))
    assert tower.position("cf3") == pytest.approx((3.0, 0.0, 0.0))


def test_a_vehicle_flies_and_lands_beside_two_that_rest_near_each_other():
    group = DryRun({"cf0": (0.0, 0.0, 0.0), "cf1": (0.28, 0.0, 0.0), "cf2": (2.0, 0.0, 0.0)})
    group["cf2"].takeoff(1.0)
    group.land()
    assert places(group)[:, 2] == pytest.approx(0.0)
    with pytest.raises(MissionError, match="cf0 and cf1 would be 0.28 m apart"):
        group["cf1"].takeoff(1.0)


def test_after_an_error_likewise():
    group = DryRun(ROW)
    with pytest.raises(ZeroDivisionError), group:
        to_the_tower(group)
        found = watch(group)
        group.wait(1 / 0)
    assert group.flying == []
    assert min(found) >= 0.3


def test_some_land_while_others_are_beneath_them(tower):
    found = watch(tower)
    tower["cf2"].land()
    x, y, z = tower.position("cf2")
    assert z == pytest.approx(0.0)
    assert 0.3 <= math.hypot(x, y) < 0.6
    assert tower.flying == ["cf0", "cf1", "cf3"]
    assert min(found) >= 0.3


def test_who_is_on_the_ground_is_not_landed_on(tower):
    tower["cf0"].land()
    found = watch(tower)
    tower["cf1"].land()
    assert math.hypot(*tower.position("cf1")[:2]) >= 0.3
    assert min(found) >= 0.3


def test_vehicles_on_their_way_stop_before_they_land(tower):
    tower["cf3"].go_to((1.5, 0.0, 1.0), wait=False)
    tower.wait(1.0)
    begin, _, _ = tower.position("cf3")
    tower.land()
    x, _, z = tower.position("cf3")
    assert begin - 0.8 < x < begin
    assert z == pytest.approx(0.0)


def test_who_does_not_reach_a_free_place_stays_in_the_air_and_is_named(tower):
    def stay(move):
        return go_to(move._replace(goal=tower.position("cf1")))

    go_to = tower._vehicles["cf1"].go_to
    tower._vehicles["cf1"].go_to = stay
    text = "cf1: land: stays in the air: its distance from the free place to land at .* is 0.3"
    with pytest.raises(MissionError, match=text):
        tower.land()
    assert tower.flying == ["cf1"]
    assert tower.position("cf1") == pytest.approx((0.0, 0.0, 2.0))
    assert tower.position("cf2")[2] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("measured", "counts"),
    [(None, (0.0, 0.0, 2.0)), ((0.1, 0.0, 2.0), (0.0, 0.0, 2.0)), ((0.2, 0.0, 2.0),) * 2],
)
def test_a_vehicle_that_is_not_where_it_should_be_counts_where_it_is(
    tower, monkeypatch, measured, counts
):
    monkeypatch.setattr(tower._vehicles["cf1"], "position", lambda: measured)
    assert tower._places()["cf1"] == pytest.approx(counts)


def test_the_way_aside_takes_as_long_as_the_limits_demand(tower, monkeypatch):
    vehicle, ways = tower._vehicles["cf1"], []
    go_to = vehicle.go_to

    def note(move):
        ways.append((math.dist(vehicle.position(), move.goal), move.duration))
        return go_to(move)

    monkeypatch.setattr(vehicle, "go_to", note)
    tower["cf1"].land()
    distance, duration = ways[0]
    # From rest to rest the polynomial has at most 7.513 times the distance per duration squared.
    assert duration == pytest.approx(math.sqrt(7.513 * distance / 1.0), rel=0.01)


def test_a_vehicle_that_is_late_at_a_free_place_is_waited_for(tower, monkeypatch):
    vehicle, clock = tower._vehicles["cf1"], tower.clock

    def land(height, duration):
        monkeypatch.undo()
        return vehicle.land(height, duration)

    monkeypatch.setattr(vehicle, "land", land)
    monkeypatch.setattr(
        vehicle, "position", lambda: vehicle.trajectory.goal(clock.time() - 1.0).position
    )
    tower.land()
    assert tower.flying == []


def test_a_vehicle_that_touches_down_late_is_waited_for(tower, monkeypatch):
    vehicle, clock = tower._vehicles["cf3"], tower.clock
    monkeypatch.setattr(vehicle, "has_landed", lambda: clock.time() > vehicle.trajectory.end + 1.0)
    tower.land()
    assert tower.flying == []


def test_a_vehicle_that_does_not_come_down_is_named(tower, monkeypatch):
    monkeypatch.setattr(tower._vehicles["cf3"], "has_landed", lambda: False)
    with pytest.raises(MissionError, match="^cf3: land: not on the ground 15 s after it should be"):
        tower.land()
    assert tower.flying == ["cf3"]
    assert tower._commanded["cf3"].destination.position == pytest.approx((3.0, 0.0, 0.0))


def test_without_a_free_place_a_mission_is_refused_before_it_flies():
    corridor = Rules(bounds=Bounds((-0.05, -0.01, 0.0), (0.75, 0.01, 4.0)), separation=0.7)
    group = DryRun({"cf0": (0.0, 0.0, 0.0), "cf1": (0.7, 0.0, 0.0)}, corridor)

    def mission(fleet):
        fleet.takeoff(1.0)
        fleet["cf1"].go_to((0.7, 0.0, 2.8))
        fleet["cf1"].go_to((0.3, 0.0, 2.8))

    with pytest.raises(
        MissionError, match=r"cf0 and cf1 would be 0\.\d+ m apart, .* at least 0.7 m"
    ):
        dry_run(group, mission)


def test_a_lattice_lands_where_it_is():
    names = [f"cf{k}" for k in range(27)]
    axis = np.arange(3)
    floor = np.stack(np.meshgrid(np.arange(9), axis, indexing="ij"), axis=-1).reshape(-1, 2)
    group = DryRun(
        {name: (*map(float, place), 0.0) for name, place in zip(names, floor, strict=True)}
    )
    cube = np.stack(np.meshgrid(0.7 * axis, 0.7 * axis, 1.4 * axis + 1.0), axis=-1).reshape(-1, 3)
    group.takeoff(1.0)
    group.formation(cube)
    found = watch(group)
    group.land()
    assert group.flying == []
    assert min(found) >= 0.3
    assert pdist(places(group)).min() >= 0.3


def test_a_flight_ends_so_too(monkeypatch, tmp_path):
    swarm = Swarm(monkeypatch, tmp_path, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    with pytest.raises(ZeroDivisionError), swarm.fleet() as fleet:
        one_above_the_other(fleet)
        fleet.wait(1 / 0)
    assert swarm.track("cf1")[-1, 2] == swarm.track("cf2")[-1, 2] == 0.0
    # Buffers are 0.15 m.
    assert swarm.nearest() > 0.3
    # Nothing is left to be landed for it: a mission that is not heard of for 5 s has died.
    swarm.process.advance(6.0)
    assert swarm.process.logged("error") == []


def test_when_a_script_is_killed_the_fleet_lands_its_vehicles(monkeypatch, tmp_path):
    swarm = Swarm(monkeypatch, tmp_path, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    fleet = swarm.fleet()
    one_above_the_other(fleet)
    # Longer than one that is not heard of is waited for.
    fleet.wait(8.0)
    assert swarm.track("cf2")[-1, 2] > 1.7
    # All that it had goes with its process.
    fleet._handle.close()
    for _ in range(40):
        swarm.process.advance(1.0)
        if {swarm.track(name)[-1, 2] for name in swarm.names} == {0.0}:
            break
    assert swarm.track("cf1")[-1, 2] == swarm.track("cf2")[-1, 2] == 0.0
    assert swarm.nearest() > 0.3
    (text,) = swarm.process.logged("error")
    assert text.startswith("/fleet: no message from the mission that flew cf1, cf2 for 5 s")


def one_above_the_other(fleet):
    fleet.takeoff(0.8)
    fleet["cf2"].go_to((1.0, 0.0, 1.8))
    fleet["cf2"].go_to((0.0, 0.0, 1.8))
