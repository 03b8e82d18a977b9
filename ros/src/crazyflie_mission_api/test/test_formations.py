"""Formations, and the lattice of a hundred, flown by the model under its controller."""

import runpy
import subprocess
import sys

import model_flight
import numpy as np
import pytest
import rospkg
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import pdist

from crazyflie_mission_api import DryRun
from crazyflie_mission_api.formations import assign, circle, lattice
from crazyflie_mission_api.group_state import Rules

PACKAGES = rospkg.RosPack()
GAINS = PACKAGES.get_path("crazyflie_lqr") + "/config/K_soft.txt"
EXAMPLES = PACKAGES.get_path("crazyflie_mission_api") + "/examples"


def test_places():
    box = lattice((2, 3, 4), 0.5, (1.0, 0.0, 2.0))
    assert box.shape == (24, 3)
    assert pdist(box).min() == pytest.approx(0.5)
    np.testing.assert_allclose(box.mean(axis=0), (1.0, 0.0, 2.0))
    pair = lattice((1, 2, 2), (3.0, 1.0, 0.5), (1.0, 0.0, 2.0))
    assert pair.tolist() == [[1, -0.5, 1.75], [1, -0.5, 2.25], [1, 0.5, 1.75], [1, 0.5, 2.25]]
    ring = circle(4, 2.0, (1.0, 0.0, 0.5))
    np.testing.assert_allclose(
        ring, [(3, 0, 0.5), (1, 2, 0.5), (-1, 0, 0.5), (1, -2, 0.5)], atol=1e-12
    )


@given(st.integers(0, 10**6))
def test_no_two_vehicles_meet_on_simultaneous_straight_moves(seed):
    # CAPT: with starts and goals a apart, at least a / sqrt(2).
    draw = np.random.default_rng(seed)
    starts, goals = (draw.permutation(lattice((3, 3, 1), 1.0))[:6] for _ in range(2))
    names = [f"cf{k}" for k in range(6)]
    chosen = assign(dict(zip(names, map(tuple, starts), strict=True)), goals)
    assert sorted(chosen.values()) == sorted(map(tuple, goals.tolist()))
    ends = np.array([chosen[name] for name in names])
    for s in np.linspace(0.0, 1.0, 21):
        assert pdist(starts + s * (ends - starts)).min() > 1.0 / np.sqrt(2.0) - 1e-9


def test_a_way_up_counts_less_than_one_to_the_side():
    # By 1 m to the side each, or by 1.5 m up and down, which is as 0.75 m to the side.
    places = {"low": (0.0, 0.0, 0.5), "high": (1.0, 0.0, 2.0)}
    goals = np.array([(1.0, 0.0, 0.5), (0.0, 0.0, 2.0)])
    assert assign(places, goals) == {"low": (0.0, 0.0, 2.0), "high": (1.0, 0.0, 0.5)}


@pytest.mark.parametrize("n", [1, 7])
def test_the_lattice_of_any_number(n):
    example = runpy.run_path(f"{EXAMPLES}/lattice.py")
    starts = {f"cf{k}": tuple(place) for k, place in enumerate(example["square"](n).tolist())}
    group = DryRun(starts, Rules(example["LIMITS"]))
    example["mission"](group)
    assert group.flying == []
    assert {tuple(np.round(group.position(name), 6)) for name in starts} == set(starts.values())


@pytest.mark.parametrize("example", ["lattice", "figure_eights"])
@pytest.mark.parametrize("spacing", [1.0, 1.8])
def test_the_examples_fly_in_a_fleet_as_it_is_launched(example, spacing):
    """A grid of sw_swarm.launch, with its spacing and with more."""
    example = runpy.run_path(f"{EXAMPLES}/{example}.py")
    places = [(spacing * (k // 2), spacing * (k % 2), 0.0) for k in range(3)]
    starts = {f"cf{k + 1}": place for k, place in enumerate(places)}
    group = DryRun(starts, Rules(example["LIMITS"]))
    example["mission"](group)
    assert group.flying == []


def test_the_lattice_takes_names():
    """The dashboard's page gives those of the chosen vehicles."""
    command = [sys.executable, f"{EXAMPLES}/lattice.py", "cf3", "dry_run"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout[:10]) == (0, "2 vehicles")


# In both, vehicles are as near to each other as anywhere in the lattice, on every side.
@pytest.mark.parametrize("n", [36, pytest.param(100, marks=pytest.mark.long)])
def test_many_vehicles_fly_the_lattice(n):
    example = runpy.run_path(f"{EXAMPLES}/lattice.py")
    starts = {f"cf{k}": tuple(place) for k, place in enumerate(example["square"](n).tolist())}
    group = DryRun(starts, Rules(example["LIMITS"]))
    flight = model_flight.fly(group, example["mission"], GAINS)
    assert flight.error < 0.5
    assert flight.distance > 0.5
    assert flight.at_limit == 0.0
