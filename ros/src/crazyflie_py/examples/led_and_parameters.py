#!/usr/bin/env python
"""Firmware parameters, and LED rings that change their colour while the vehicles hover."""

import colorsys

from pycrazyswarm import Crazyswarm

SOLID_COLOR = 7


def main():
    swarm = Crazyswarm()
    helper, allcfs = swarm.timeHelper, swarm.allcfs
    allcfs.setParam("ring/effect", SOLID_COLOR)
    for cf in allcfs.crazyflies:
        cf.setParams({"hlCommander/vtoff": 0.5, "hlCommander/vland": 0.4})
        print(cf.id, cf.getParam("ring/effect"), cf.getParam("hlCommander/vtoff"))
    allcfs.takeoff(0.8, 2.0)
    helper.sleep(2.5)
    for step in range(12):
        for number, cf in enumerate(allcfs.crazyflies):
            cf.setLEDColor(*colorsys.hsv_to_rgb(step / 12 + number / 3, 1.0, 1.0))
        helper.sleep(0.25)
    allcfs.land(0.04, 2.0)
    helper.sleep(3.0)


if __name__ == "__main__":
    main()
