#!/usr/bin/env python
"""Broadcasts for groups: vehicles with odd ids climb first."""

from crazyflie_py import Crazyswarm

ODD, EVEN = 0b01, 0b10


def main():
    swarm = Crazyswarm()
    helper, allcfs = swarm.timeHelper, swarm.allcfs
    for cf in allcfs.crazyflies:
        cf.setGroupMask(ODD if cf.id % 2 else EVEN)
    for group, height in ((ODD, 1.0), (EVEN, 0.5)):
        allcfs.takeoff(height, 2.0, groupMask=group)
        helper.sleep(2.5)
    allcfs.goTo([0.0, 0.0, 0.5], 0.0, 2.0, groupMask=EVEN)
    helper.sleep(2.5)
    allcfs.land(0.04, 2.0, groupMask=ODD | EVEN)
    helper.sleep(3.0)


if __name__ == "__main__":
    main()
