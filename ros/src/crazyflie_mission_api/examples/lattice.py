#!/usr/bin/env python
"""Many vehicles rise from a square on the floor into a lattice, form a ring, and come back.

Usage: lattice.py [N | NAME ...], the number of vehicles, cf1, cf2, ... as in sw_swarm.launch, by
default 100; or their names. With a number and the word "dry_run" after it nothing flies, and no ROS
is needed.
"""

import math
import sys

import crazyflie_mission_api
from crazyflie_fleet.fleet_config import DOWNWASH
from crazyflie_mission_api import DryRun, Limits
from crazyflie_mission_api.formations import Array, circle, lattice
from crazyflie_mission_api.group_state import Rules
from crazyflie_mission_api.vehicle_group import VehicleGroup

SPACING = 0.7  #: Distance of neighbours (m).
LAYERS = DOWNWASH * SPACING  #: Distance of the layers of the lattice (m).

LIMITS = Limits(speed=1.0, acceleration=1.5)


def cube(n: int) -> Array:
    """Return the first n places of a cube, from below, m."""
    side = math.ceil(n ** (1.0 / 3.0))
    center = (0.0, 0.0, 1.0 + LAYERS * (side - 1) / 2.0)
    places = lattice((side, side, side), (SPACING, SPACING, LAYERS), center)
    return places[places[:, 2].argsort(kind="stable")][:n]


def ring(n: int) -> Array:
    """Return n places on a circle, m."""
    return circle(n, max(1.0, n * SPACING / (2.0 * math.pi)), (0.0, 0.0, 1.5))


def mission(fleet: VehicleGroup) -> None:
    """Fly it."""
    fleet.takeoff(1.0)
    begin = [fleet.position(name) for name in fleet.names]
    for places in (cube(len(begin)), ring(len(begin)), begin):
        fleet.formation(places)
        fleet.wait(1.0)
    fleet.land()


def square(n: int) -> Array:
    """Return the start points of the vehicles, m."""
    side = math.ceil(math.sqrt(n))
    return lattice((side, side, 1), 1.0, (0.0, 0.0, 0.0))[:n]


if __name__ == "__main__":
    names = sys.argv[1:]
    if not names or names[0].isdecimal():
        names = [f"cf{k + 1}" for k in range(int(names[0]) if names else 100)]
    # Earlier versions used the word "rehearse".
    if sys.argv[2:] in (["dry_run"], ["rehearse"]):
        places = map(tuple, square(len(names)).tolist())
        dry_run = DryRun(dict(zip(names, places, strict=True)), Rules(LIMITS))
        mission(dry_run)
        print(f"{len(names)} vehicles, {dry_run.time():.0f} s, no two come too near")
    else:
        with crazyflie_mission_api.Fleet(names, limits=LIMITS) as group:
            group.fly(mission)
