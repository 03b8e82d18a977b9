#!/usr/bin/env python
"""Two vehicles take off, fly half a metre ahead, and land: as a mission."""

from crazyflie_mission_api import Fleet


def mission(fleet):
    """Fly; each line returns when it is done."""
    fleet.takeoff(1.0)
    fleet.go_to({name: (0.5, 0.0, 0.0) for name in fleet.names}, relative=True)
    fleet.land()


if __name__ == "__main__":
    with Fleet(["cf1", "cf2"]) as fleet:
        fleet.fly(mission)
