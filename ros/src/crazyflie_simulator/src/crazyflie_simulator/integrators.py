"""Numerical integration with a fixed step."""

from collections.abc import Callable

import numpy as np


def rk4_step(derivative: Callable, t: float, x: np.ndarray, u: np.ndarray, dt: float) -> np.ndarray:
    """Return the state one classical Runge-Kutta step (4th order) later.

    Parameters
    ----------
    derivative : callable
        ``derivative(t, x, u)``, shape of x.
    t : float
        Time at the beginning of the step, s.
    x : ndarray, shape (..., x_dim)
        State at ``t``.
    u : ndarray, shape (..., u_dim)
        Control, constant over the step.
    dt : float
        Step, s.

    Returns
    -------
    ndarray, shape (..., x_dim)
        State at ``t + dt``.
    """
    k1 = derivative(t, x, u)
    k2 = derivative(t + dt / 2.0, x + dt / 2.0 * k1, u)
    k3 = derivative(t + dt / 2.0, x + dt / 2.0 * k2, u)
    k4 = derivative(t + dt, x + dt * k3, u)
    return x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
