"""Trajectories of polynomials: the module that users' scripts import by this name."""

from crazyflie_demo.uav_trajectory import Polynomial, Polynomial4D, Trajectory, TrajectoryOutput

__all__ = ["Polynomial", "Polynomial4D", "Trajectory", "TrajectoryOutput"]
