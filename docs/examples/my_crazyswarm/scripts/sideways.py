#!/usr/bin/env python
"""Take off, go sideways together, land."""

import numpy as np
from pycrazyswarm import Crazyswarm


def main():
    """Fly."""
    swarm = Crazyswarm()
    helper, vehicles = swarm.timeHelper, swarm.allcfs
    vehicles.takeoff(targetHeight=1.0, duration=2.5)
    helper.sleep(3.0)
    for vehicle in vehicles.crazyflies:
        vehicle.goTo(np.array(vehicle.initialPosition) + [0.5, 0.0, 1.0], 0.0, 3.0)
    helper.sleep(3.5)
    vehicles.land(targetHeight=0.04, duration=2.5)
    helper.sleep(3.0)


if __name__ == "__main__":
    main()
