#!/usr/bin/env python
"""All vehicles dance: the same steps, relative to each one's position, and half a turn."""

import math

from crazyflie_py import Crazyswarm

STEPS = [(0.3, 0.0, 0.0), (0.0, 0.3, 0.2), (-0.3, 0.0, -0.2), (0.0, -0.3, 0.0)]


def main():
    swarm = Crazyswarm()
    helper, allcfs = swarm.timeHelper, swarm.allcfs
    allcfs.takeoff(1.0, 2.5)
    helper.sleep(3.0)
    for step in STEPS:
        allcfs.goTo(step, yaw=math.pi / 8.0, duration=1.5)
        helper.sleep(2.0)
    allcfs.land(0.04, 2.5)
    helper.sleep(3.0)


if __name__ == "__main__":
    main()
