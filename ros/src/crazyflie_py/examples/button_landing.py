#!/usr/bin/env python
"""All vehicles take off at the press of a button, and land at the next."""

from pycrazyswarm import Crazyswarm


def main():
    swarm = Crazyswarm()
    helper, allcfs = swarm.timeHelper, swarm.allcfs
    print("press button to take off")
    swarm.input.waitUntilButtonPressed()
    allcfs.takeoff(0.8, 2.0)
    helper.sleep(2.5)
    print("press button to land")
    while not helper.isShutdown() and not swarm.input.checkIfButtonIsPressed():
        helper.sleep(0.1)
    allcfs.land(0.04, 2.0)
    helper.sleep(3.0)


if __name__ == "__main__":
    main()
