"""Equations of motion of the 7-dimensional vehicle models.

State x = (x, y, z, x_dot, y_dot, z_dot, yaw) in the fixed frame (z up), m, m/s
and rad. Control u = (roll, pitch, yaw_dot, thrust) in rad, rad/s and m/s^2
(mass-normalised): the attitude is taken to follow its command at once.

All functions take single vectors or batches: the last axis counts state or
control, the axes before it vehicles.
"""

from abc import ABC, abstractmethod

import numpy as np

from crazyflie_utils.angles import quaternion_from_rpy
from crazyflie_utils.units import GRAVITY


class Dynamics(ABC):
    """What a simulated vehicle needs to know of its model."""

    x_dim: int
    u_dim: int = 4

    @abstractmethod
    def derivative(self, t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the time derivative of the state.

        Parameters
        ----------
        t : float
            Time, s.
        x : ndarray, shape (..., x_dim)
        u : ndarray, shape (..., u_dim)

        Returns
        -------
        ndarray, shape (..., x_dim)
        """

    @abstractmethod
    def initial_state(self, position) -> np.ndarray:
        """Return the state at rest at a position (m), shape (x_dim,)."""

    @abstractmethod
    def on_ground(self, x: np.ndarray) -> np.ndarray:
        """Return the state with the ground, z = 0, taken into account.

        A vehicle below the ground is put on it and loses its downward speed.
        """

    @abstractmethod
    def pose(self, x: np.ndarray, u: np.ndarray) -> tuple:
        """Return the position (3,) in m and the quaternion (x, y, z, w) of one vehicle."""


class SevenDimensional(Dynamics):
    """What the models with this state have in common."""

    x_dim = 7

    def initial_state(self, position) -> np.ndarray:
        """See `Dynamics.initial_state`; yaw is 0."""
        return np.concatenate([position, np.zeros(4)])

    def on_ground(self, x: np.ndarray) -> np.ndarray:
        """See `Dynamics.on_ground`."""
        below = x[..., 2] <= 0.0
        if not below.any():
            return x
        x = x.copy()
        x[..., 2] = np.where(below, 0.0, x[..., 2])
        x[..., 5] = np.where(below, np.maximum(x[..., 5], 0.0), x[..., 5])
        return x

    def pose(self, x: np.ndarray, u: np.ndarray) -> tuple:
        """See `Dynamics.pose`: roll and pitch are those of the control, yaw is the state's."""
        return x[:3], quaternion_from_rpy(u[0], u[1], x[6])


class NearHover(SevenDimensional):
    """Small angles about hover, yaw kept apart: tilt does not cost lift."""

    def derivative(self, t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """See `Dynamics.derivative`.

        x_ddot = g tan(pitch), y_ddot = -g tan(roll), z_ddot = thrust - g, and
        the yaw rate is commanded.
        """
        x_dot = np.empty(np.broadcast_shapes(x.shape[:-1], u.shape[:-1]) + (7,))
        x_dot[..., 0:3] = x[..., 3:6]
        x_dot[..., 3] = GRAVITY * np.tan(u[..., 1])
        x_dot[..., 4] = -GRAVITY * np.tan(u[..., 0])
        x_dot[..., 5] = u[..., 3] - GRAVITY
        x_dot[..., 6] = u[..., 2]
        return x_dot
