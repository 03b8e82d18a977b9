#!/usr/bin/env python
"""The first vehicle flies a circle by velocities."""

import math

from pycrazyswarm import Crazyswarm

RATE = 30.0
RADIUS = 0.4
PERIOD = 6.0


def main():
    swarm = Crazyswarm()
    helper = swarm.timeHelper
    cf = swarm.allcfs.crazyflies[0]
    cf.takeoff(targetHeight=0.8, duration=2.0)
    helper.sleep(2.5)
    begin = helper.time()
    speed = 2.0 * math.pi * RADIUS / PERIOD
    while not helper.isShutdown() and (t := helper.time() - begin) < PERIOD:
        angle = 2.0 * math.pi * t / PERIOD
        cf.cmdVelocityWorld([-speed * math.sin(angle), speed * math.cos(angle), 0.0], yawRate=0.0)
        helper.sleepForRate(RATE)
    cf.cmdVelocityWorld([0.0, 0.0, 0.0], yawRate=0.0)
    cf.notifySetpointsStop()
    cf.land(targetHeight=0.04, duration=2.0)
    helper.sleep(3.0)


if __name__ == "__main__":
    main()
