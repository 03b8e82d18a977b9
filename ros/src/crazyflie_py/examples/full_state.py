#!/usr/bin/env python
"""The first vehicle tracks setpoints of a trajectory, which this script sends."""

from pathlib import Path

from pycrazyswarm import Crazyswarm
from uav_trajectory import Trajectory

RATE = 50.0
STRETCH = 1.5


def main():
    swarm = Crazyswarm()
    helper = swarm.timeHelper
    cf = swarm.allcfs.crazyflies[0]
    trajectory = Trajectory()
    trajectory.loadcsv(Path(__file__).parent / "figure8.csv")
    trajectory.stretchtime(STRETCH)
    cf.takeoff(targetHeight=0.8, duration=2.0)
    helper.sleep(2.5)
    origin = cf.initialPosition + [0.0, 0.0, 0.8]
    begin = helper.time()
    while not helper.isShutdown() and (t := helper.time() - begin) < trajectory.duration:
        goal = trajectory.eval(t)
        cf.cmdFullState(origin + goal.pos, goal.vel, goal.acc, goal.yaw, goal.omega)
        helper.sleepForRate(RATE)
    cf.notifySetpointsStop()
    cf.land(targetHeight=0.04, duration=2.0)
    helper.sleep(3.0)


if __name__ == "__main__":
    main()
