#!/usr/bin/env python
"""Two vehicles take off, fly half a metre ahead, and land: by Crazyswarm's API."""

from crazyflie_py import Crazyswarm


def main():
    """Fly."""
    swarm = Crazyswarm()
    allcfs, helper = swarm.allcfs, swarm.timeHelper
    allcfs.takeoff(targetHeight=1.0, duration=3.0)
    helper.sleep(4.0)
    allcfs.goTo([0.5, 0.0, 0.0], yaw=0.0, duration=3.0)
    helper.sleep(4.0)
    allcfs.land(targetHeight=0.04, duration=3.0)
    helper.sleep(4.0)


if __name__ == "__main__":
    main()
