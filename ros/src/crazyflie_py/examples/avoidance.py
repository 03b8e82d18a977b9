#!/usr/bin/env python
"""The first two vehicles swap their places at one height; the firmware keeps them apart."""

import numpy as np
from pycrazyswarm import Crazyswarm

RADII = np.array([0.18, 0.18, 0.54])


def main():
    swarm = Crazyswarm()
    helper, allcfs = swarm.timeHelper, swarm.allcfs
    one, two = allcfs.crazyflies[:2]
    one.enableCollisionAvoidance([two], RADII)
    two.enableCollisionAvoidance([one], RADII)
    allcfs.takeoff(1.0, 2.0)
    helper.sleep(2.5)
    one.goTo(two.initialPosition + [0.0, 0.0, 1.0], 0.0, 5.0)
    two.goTo(one.initialPosition + [0.0, 0.0, 1.0], 0.0, 5.0)
    helper.sleep(8.0)
    one.disableCollisionAvoidance()
    two.disableCollisionAvoidance()
    allcfs.land(0.04, 2.0)
    helper.sleep(3.0)


if __name__ == "__main__":
    main()
