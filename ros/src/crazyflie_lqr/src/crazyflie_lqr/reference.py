"""The reference a controller follows while its source may fail."""

import numpy as np
from numpy.typing import NDArray

from crazyflie_lqr.linear_feedback import at_rest
from crazyflie_utils.last_valid import LastValid


class GuardedReference:
    """The last valid reference; or, some time after invalid ones came, a hold point.

    A setpoint from a broken source is not followed for ever, yet the vehicle is
    not dropped: `crazyflie_utils.last_valid.HOLD_LIMIT` after the first invalid
    reference it stops where it is, and stays there until a valid one comes.

    Parameters
    ----------
    yaw_index : int
        Where the yaw is in the state.
    """

    def __init__(self, yaw_index: int):
        self._yaw_index = yaw_index
        self._last_valid: LastValid[NDArray[np.float64]] = LastValid()
        self._hold_point: NDArray[np.float64] | None = None
        self._has_arrived = False

    def update(self, x_ref: NDArray[np.float64]) -> None:
        """Take a valid reference, shape (x_dim,)."""
        self._last_valid.update(x_ref)
        self._hold_point = None
        self._has_arrived = True

    def invalidate(self, time: float) -> None:
        """Take note that an invalid reference came at ``time`` (s)."""
        self._last_valid.invalidate(time)

    def value(self, time: float, x: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return what to follow.

        Parameters
        ----------
        time : float
            Now, s.
        x : ndarray, shape (x_dim,)
            State of the vehicle.

        Returns
        -------
        ndarray, shape (x_dim,), or None
            None before the first valid reference.
        """
        x_ref = self._last_valid.value(time)
        if x_ref is None and self._has_arrived:
            if self._hold_point is None:
                self._hold_point = at_rest(x, self._yaw_index)
            x_ref = self._hold_point
        return x_ref
