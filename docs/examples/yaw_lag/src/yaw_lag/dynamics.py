"""Near-hover dynamics with a yaw rate that follows its command with a first-order lag.

State x = (x, y, z, x_dot, y_dot, z_dot, yaw, yaw_dot) in the fixed frame, m, m/s,
rad and rad/s; control as everywhere: roll, pitch, yaw_dot, thrust.
"""

from collections.abc import Sequence

from typing_extensions import override

from crazyflie_model.angles import Quaternion, Triple
from crazyflie_model.dynamics import Dynamics, NearHover
from crazyflie_model.elementwise import Number, Vector


class YawLag(Dynamics):
    """Near hover, and yaw_ddot = (commanded yaw_dot - yaw_dot) / time_constant (s)."""

    x_dim = 8

    def __init__(self, time_constant: float):
        self._time_constant = time_constant
        self._near_hover = NearHover()

    @override
    def initial_state(self, position: Sequence[Number]) -> Vector:
        return [*self._near_hover.initial_state(position), 0.0]

    @override
    def rates(self, t: float, x: Vector, u: Vector) -> Vector:
        *others, yaw_dot = x
        roll, pitch, commanded, thrust = u
        rates = self._near_hover.rates(t, others, [roll, pitch, yaw_dot, thrust])
        return [*rates, (commanded - yaw_dot) / self._time_constant]

    @override
    def apply_ground_contact(self, x: Vector) -> Vector:
        return [*self._near_hover.apply_ground_contact(x[:7]), x[7]]

    @override
    def pose(self, x: Vector, u: Vector) -> tuple[Triple, Quaternion]:
        # Roll and pitch are those of the control.
        return self._near_hover.pose(x[:7], u)
