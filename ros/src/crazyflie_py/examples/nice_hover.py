#!/usr/bin/env python
"""All vehicles take off, and each hovers exactly above its start."""

import numpy as np

from crazyflie_py import Crazyswarm

HEIGHT = 1.0


def main():
    swarm = Crazyswarm()
    helper, allcfs = swarm.timeHelper, swarm.allcfs
    allcfs.takeoff(targetHeight=HEIGHT, duration=1.0 + HEIGHT)
    helper.sleep(1.5 + HEIGHT)
    for cf in allcfs.crazyflies:
        cf.goTo(np.array(cf.initialPosition) + [0.0, 0.0, HEIGHT], 0.0, 1.0)
    helper.sleep(3.0)
    allcfs.land(targetHeight=0.02, duration=1.0 + HEIGHT)
    helper.sleep(2.0 + HEIGHT)


if __name__ == "__main__":
    main()
