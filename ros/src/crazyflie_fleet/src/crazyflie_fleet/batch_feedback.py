"""The control law of `crazyflie_lqr` for many vehicles at once."""

import numpy as np
from numpy.typing import NDArray

from crazyflie_lqr.linear_feedback import IntegralStateFeedback
from crazyflie_model.angles import wrap_to_pi
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST

YAW = 6

_LEAST = np.array([-MAX_TILT, -MAX_TILT, -np.inf, MIN_THRUST])
_MOST = np.array([MAX_TILT, MAX_TILT, np.inf, MAX_THRUST])


def batch_control(
    K: NDArray[np.float64],
    u_ref: NDArray[np.float64],
    x: NDArray[np.float64],
    x_ref: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the controls of an `IntegralStateFeedback` without an integrator.

    Parameters
    ----------
    K : ndarray, shape (4, 7)
    u_ref : ndarray, shape (4,)
    x, x_ref : ndarray, shape (n, 7)
        States and references.

    Returns
    -------
    ndarray, shape (n, 4)
    """
    e = x - x_ref
    c, s = np.cos(x[:, YAW]), np.sin(x[:, YAW])
    for i, j in ((0, 1), (3, 4)):
        e[:, i], e[:, j] = c * e[:, i] + s * e[:, j], c * e[:, j] - s * e[:, i]
    e[:, YAW] = wrap_to_pi(e[:, YAW])
    return np.clip(u_ref + e @ K.T, _LEAST, _MOST)


def is_memoryless(K: NDArray[np.float64], u_ref: NDArray[np.float64]) -> bool:
    """Tell whether the controller with these gains, and no integrator, is `batch_control`.

    It is not if it leads its vehicle up along a climb, instead of by a step of the reference.
    """
    controller = IntegralStateFeedback(K, u_ref, YAW)
    controller.take_off()
    low, high = np.zeros(7), np.zeros(7)
    high[2] = 1e-3
    alone = controller.control(low, high, 0.0)
    return np.allclose(alone, batch_control(K, u_ref, low[None], high[None])[0], rtol=0, atol=1e-12)
