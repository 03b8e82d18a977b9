"""A vehicle to try a controller on: a point whose tilt follows the command with a lag."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

TIME_STEP = 0.01
TILT_LAG = 0.1
"""s."""

GRAVITY = 9.81


def fly(
    control: Callable[[Vector, Vector, float], Vector],
    reference: Callable[[float], Vector],
    duration: float,
    start: Vector,
) -> tuple[Vector, Vector]:
    """Return states, shape (n, 7), and controls, shape (n, 4), of a flight of n steps of 10 ms.

    Parameters
    ----------
    control : callable
        (state, reference, time) -> control. States are x, y, z, their velocities, and the yaw;
        controls are roll, pitch, yaw rate and thrust. SI units, rad.
    reference : callable
        time -> state, shape (7,).
    duration : float
        s.
    start : ndarray, shape (7,)
    """
    x, tilt = start.astype(float), np.zeros(2)
    states, controls = [], []
    for k in range(round(duration / TIME_STEP)):
        time = k * TIME_STEP
        u = np.asarray(control(x.copy(), reference(time), time), dtype=float)
        states.append(x.copy())
        controls.append(u)
        tilt += (u[:2] - tilt) * TIME_STEP / TILT_LAG
        ahead, left = u[3] * np.sin(tilt[1]), -u[3] * np.sin(tilt[0])
        up = u[3] * np.cos(tilt[0]) * np.cos(tilt[1]) - GRAVITY
        cosine, sine = np.cos(x[6]), np.sin(x[6])
        a = np.array([cosine * ahead - sine * left, sine * ahead + cosine * left, up])
        x[:3] += x[3:6] * TIME_STEP + a * TIME_STEP**2 / 2.0
        x[3:6] += a * TIME_STEP
        x[6] += u[2] * TIME_STEP
    return np.array(states), np.array(controls)
