#!/usr/bin/env python
"""The first vehicle takes off, hovers and lands."""

from pycrazyswarm import Crazyswarm


def main():
    swarm = Crazyswarm()
    cf = swarm.allcfs.crazyflies[0]
    cf.takeoff(targetHeight=1.0, duration=2.5)
    swarm.timeHelper.sleep(4.0)
    cf.land(targetHeight=0.04, duration=2.5)
    swarm.timeHelper.sleep(3.0)


if __name__ == "__main__":
    main()
