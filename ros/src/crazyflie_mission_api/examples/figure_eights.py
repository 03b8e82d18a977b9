#!/usr/bin/env python
"""Eight vehicles fly figures of eight side by side, every second one in the opposite direction.

Usage: figure_eights.py [NAME ...], the vehicles; by default cf1 ... cf8. If two of them are less
than 1.2 m apart, all fly in the same direction.
"""

import itertools
import math
import sys

from crazyflie_demo.figure8 import figure8
from crazyflie_mission_api import Fleet, Limits
from crazyflie_mission_api.vehicle_group import VehicleGroup
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_model.trajectory import Pieces

SPACING = 1.2  #: Distance from which figures of eight in opposite directions do not collide (m).

LIMITS = Limits(speed=1.0, acceleration=1.5)


def mirrored(pieces: Pieces) -> list[PolynomialPiece]:
    """Return a trajectory with left and right exchanged."""
    return [
        PolynomialPiece(piece.duration, piece.x, [-c for c in piece.y], piece.z, piece.yaw)
        for piece in pieces
    ]


def mission(fleet: VehicleGroup) -> None:
    """Fly it."""
    fleet.takeoff(1.0)
    places = map(fleet.position, fleet.names)
    is_dense = any(math.dist(*pair) < SPACING for pair in itertools.combinations(places, 2))
    ways = itertools.cycle([figure8()] if is_dense else [figure8(), mirrored(figure8())])
    fleet.follow(dict(zip(fleet.names, ways, strict=False)), relative=True)
    fleet.land()


if __name__ == "__main__":
    with Fleet(sys.argv[1:] or [f"cf{k}" for k in range(1, 9)], limits=LIMITS) as group:
        group.fly(mission)
