"""The reference a controller follows while its sources may fail."""

import math
from collections.abc import Callable

from crazyflie_lqr.linear_feedback import Components, at_rest
from crazyflie_utils.last_valid import LastValid

DESCENT_LIMIT = 0.3
"""How long the reference of a descent counts, and it alone, s."""


class GuardedReference:
    """The last valid reference; or, some time after invalid ones came, a hold point.

    A setpoint from a broken source is not followed for ever, yet the vehicle is
    not dropped: `crazyflie_utils.last_valid.HOLD_LIMIT` after the first invalid
    reference it stops where it is, and stays there until a valid one comes.

    A reference that is older than the present one does not count: a publisher of long ago
    may have latched it. One that is far away is moved nearer.

    Parameters
    ----------
    yaw_index : int
        Where the yaw is in the state.
    max_jump : float, optional
        How far from the vehicle a new reference may be, m. One that is further away becomes a
        place to rest at so far from the vehicle, in the same direction, and is this as long as
        references come from about there.
    report : callable, optional
        ``report(text)`` is told of that.
    """

    def __init__(
        self,
        yaw_index: int,
        max_jump: float = math.inf,
        report: Callable[[str], None] = lambda text: None,
    ):
        self.max_jump = max_jump
        self._yaw_index = yaw_index
        self._report = report
        self._last_valid: LastValid[Components] = LastValid()
        self._hold_point: Components | None = None
        self._near: Components | None = None
        self._far: Components | None = None
        self._is_new = False
        self._has_arrived = False
        self._stamp = 0.0
        self._descent: Components | None = None
        self._descent_time = 0.0

    def update(self, x_ref: Components, stamp: float = 0.0, now: float = 0.0) -> bool:
        """Take a valid reference.

        Parameters
        ----------
        x_ref : sequence, x_dim components
        stamp : float
            When it was made, s; 0 if that is not known.
        now : float
            By the same clock. What has a stamp ahead of it counts as made now.

        Returns
        -------
        bool
            False if it is older than the present one, and does not count.
        """
        # After a reset of the clock nothing can be told from the stamps of before.
        if self._stamp > now:
            self._stamp = 0.0
        if 0.0 < stamp < self._stamp:
            return False
        if stamp > 0.0:
            self._stamp = min(stamp, now)
        self._last_valid.update(x_ref)
        self._hold_point = None
        self._has_arrived = True
        self._is_new = True
        return True

    def invalidate(self, time: float) -> None:
        """Take note that an invalid reference came at ``time`` (s)."""
        self._last_valid.invalidate(time)

    def descend(self, x_ref: Components, time: float) -> None:
        """Take the reference of a descent, x_dim components, at ``time`` (s)."""
        self._descent = x_ref
        self._descent_time = time

    def value(self, time: float, x: Components) -> Components | None:
        """Return what to follow.

        Parameters
        ----------
        time : float
            Now, s.
        x : sequence, x_dim components
            State of the vehicle.

        Returns
        -------
        sequence, x_dim components, or None
            None before the first valid reference.
        """
        if self._descent is not None and 0.0 <= time - self._descent_time < DESCENT_LIMIT:
            return self._descent
        x_ref = self._last_valid.value(time)
        if x_ref is None:
            return self._hold(x) if self._has_arrived else None
        if self._is_new:
            self._is_new = False
            x_ref = self._within_reach(x_ref, x)
        return x_ref

    def _hold(self, x):
        if self._hold_point is None:
            self._hold_point = at_rest(x, self._yaw_index)
        return self._hold_point

    def _within_reach(self, x_ref, x):
        distance = math.dist(x_ref[:3], x[:3])
        if distance <= self.max_jump:
            self._near = self._far = None
            return x_ref
        self._report(
            f"the reference is {distance:.1f} m away; going {self.max_jump:g} m in its direction"
        )
        # Who repeats one that is far away must not lead the vehicle there step by step.
        is_repeated = self._far is not None and math.dist(x_ref[:3], self._far[:3]) < self.max_jump
        if self._near is None or not is_repeated:
            self._far = x_ref
            self._near = at_rest(x_ref, self._yaw_index)
            # A mean, so that neither a far one nor a short way overflows.
            share = self.max_jump / distance
            self._near[:3] = [
                (1.0 - share) * here + share * there
                for here, there in zip(x[:3], x_ref[:3], strict=True)
            ]
        self._last_valid.update(self._near)
        return self._near
