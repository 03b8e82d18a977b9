"""The module uav_trajectory, by its name in crazyswarm2."""

from uav_trajectory import Polynomial, Polynomial4D, Trajectory, TrajectoryOutput

__all__ = ["Polynomial", "Polynomial4D", "Trajectory", "TrajectoryOutput"]
