#!/usr/bin/env python
"""All vehicles fly a figure eight, and the same backwards, by their own planners."""

from pathlib import Path

from pycrazyswarm import Crazyswarm
from uav_trajectory import Trajectory

TIMESCALE = 1.5


def main():
    swarm = Crazyswarm()
    helper, allcfs = swarm.timeHelper, swarm.allcfs
    trajectory = Trajectory()
    trajectory.loadcsv(Path(__file__).parent / "figure8.csv")
    for cf in allcfs.crazyflies:
        cf.uploadTrajectory(0, 0, trajectory)
    allcfs.takeoff(targetHeight=1.0, duration=2.0)
    helper.sleep(2.5)
    for reverse in (False, True):
        allcfs.startTrajectory(0, timescale=TIMESCALE, reverse=reverse)
        helper.sleep(TIMESCALE * trajectory.duration + 1.0)
    allcfs.land(targetHeight=0.06, duration=2.0)
    helper.sleep(3.0)


if __name__ == "__main__":
    main()
