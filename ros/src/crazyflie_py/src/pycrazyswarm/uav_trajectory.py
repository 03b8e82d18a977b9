"""The module uav_trajectory, by its name in Crazyswarm 1."""

from uav_trajectory import Polynomial, Polynomial4D, Trajectory, TrajectoryOutput

__all__ = ["Polynomial", "Polynomial4D", "Trajectory", "TrajectoryOutput"]
