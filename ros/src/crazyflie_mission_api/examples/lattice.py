#!/usr/bin/env python
"""Many vehicles rise from a square on the floor into a lattice, turn it into a ring, and come back.

Usage: lattice.py [N], the number of vehicles; by default 100: cf1, cf2, ... as in sw_swarm.launch.
With the word "dry_run" after it nothing flies, and no ROS is needed.
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
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    names = [f"cf{k}" for k in range(1, number + 1)]
    # The word of earlier versions was "rehearse".
    if sys.argv[2:] in (["dry_run"], ["rehearse"]):
        dry_run = DryRun(
            dict(zip(names, map(tuple, square(number).tolist()), strict=True)), Rules(LIMITS)
        )
        mission(dry_run)
        print(f"{number} vehicles, {dry_run.time():.0f} s, nobody meets")
    else:
        with crazyflie_mission_api.Fleet(names, limits=LIMITS) as group:
            group.fly(mission)
