#!/usr/bin/env python
"""The first two vehicles swap their places, one high above the other."""

from pycrazyswarm import Crazyswarm

LOW, HIGH = 0.7, 1.6


def main():
    swarm = Crazyswarm()
    helper = swarm.timeHelper
    one, two = swarm.allcfs.crazyflies[:2]
    one.takeoff(LOW, 2.5)
    two.takeoff(HIGH, 4.0)
    helper.sleep(4.5)
    one.goTo(two.initialPosition + [0.0, 0.0, LOW], 0.0, 4.0)
    two.goTo(one.initialPosition + [0.0, 0.0, HIGH], 0.0, 4.0)
    helper.sleep(4.5)
    one.land(0.04, 2.5)
    two.land(0.04, 4.0)
    helper.sleep(4.5)


if __name__ == "__main__":
    main()
