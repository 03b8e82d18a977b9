"""The reference a controller follows while its source may fail."""

import numpy as np

from crazyflie_lqr.linear_feedback import at_rest
from crazyflie_utils.last_valid import Held


class GuardedReference:
    """The last good reference; or, some time after bad ones came, the place reached by then.

    A setpoint from a broken source is not followed for ever, yet the vehicle is
    not dropped: `crazyflie_utils.last_valid.HOLD_LIMIT` after the first bad reference
    it stops where it is, and stays there until a good reference comes.

    Parameters
    ----------
    yaw_index : int
        Where the yaw is in the state.
    """

    def __init__(self, yaw_index: int):
        self._yaw_index = yaw_index
        self._held = Held()
        self._refuge = None
        self._has_arrived = False

    def good(self, x_ref: np.ndarray) -> None:
        """Take a reference, shape (x_dim,)."""
        self._held.good(x_ref)
        self._refuge = None
        self._has_arrived = True

    def bad(self, time: float) -> None:
        """Take note that a reference that cannot be followed came at ``time`` (s)."""
        self._held.bad(time)

    def value(self, time: float, x: np.ndarray) -> np.ndarray | None:
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
            None before the first good reference.
        """
        x_ref = self._held.value(time)
        if x_ref is None and self._has_arrived:
            if self._refuge is None:
                self._refuge = at_rest(x, self._yaw_index)
            x_ref = self._refuge
        return x_ref
