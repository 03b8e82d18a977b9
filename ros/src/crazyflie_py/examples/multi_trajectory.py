#!/usr/bin/env python
"""Two trajectories in the memory of each vehicle: a wave forward, and a hop back."""

from uav_trajectory import Polynomial4D, Trajectory

from crazyflie_py import Crazyswarm


def smooth(dx, dz, duration):
    """Return a piece by dx, with a hill of height dz (m), in a duration (s), from rest to rest."""
    # 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7, and 64 s^3 (1 - s)^3.
    way = [0, 0, 0, 0, 35, -84, 70, -20]
    hill = [0, 0, 0, 64, -192, 192, -64, 0]
    x = [dx * c / duration**k for k, c in enumerate(way)]
    z = [dz * c / duration**k for k, c in enumerate(hill)]
    return Polynomial4D(duration, x, [0], z, [0])


def trajectory_of(*pieces):
    """Return a trajectory."""
    trajectory = Trajectory()
    trajectory.polynomials = list(pieces)
    trajectory.duration = sum(piece.duration for piece in pieces)
    return trajectory


def main():
    swarm = Crazyswarm()
    helper, allcfs = swarm.timeHelper, swarm.allcfs
    forward = trajectory_of(smooth(0.8, 0.3, 3.0))
    back = trajectory_of(smooth(-0.8, 0.5, 3.0))
    for cf in allcfs.crazyflies:
        cf.uploadTrajectory(0, 0, forward)
        cf.uploadTrajectory(1, forward.n_pieces(), back)
    allcfs.takeoff(1.0, 2.0)
    helper.sleep(2.5)
    for trajectory_id in (0, 1):
        allcfs.startTrajectory(trajectory_id)
        helper.sleep(3.5)
    allcfs.land(0.04, 2.0)
    helper.sleep(3.0)


if __name__ == "__main__":
    main()
