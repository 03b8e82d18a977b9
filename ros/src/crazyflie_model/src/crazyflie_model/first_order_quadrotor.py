"""A vehicle whose roll, pitch and yaw rate follow their commands with first-order lags.

It is the model that `crazyflie_identification` fits to a recorded flight: without the inner loops,
whose effect the lags describe. With small angles, which a controller keeps, it is quick and smooth.

State, 11 components: position (3) in m and velocity (3) in m/s in the fixed frame, roll, pitch and
yaw in rad (Z-Y-X, so that the tilt is in the heading frame), yaw rate in rad/s, root of the thrust
over the mass, which follows its command as the speed of the rotors does.
"""

from collections.abc import Sequence

from typing_extensions import override

from crazyflie_model.angles import Quaternion, Triple, quaternion_from_zyx
from crazyflie_model.dynamics import Dynamics, coupled_acceleration
from crazyflie_model.elementwise import Number, Vector, functions, where
from crazyflie_model.inner_loops import HEADING, TILT
from crazyflie_model.quadrotor import QuadrotorParameters
from crazyflie_model.units import GRAVITY

#: Default lags (s): those of the firmware's attitude loops, which turn an error into a rate; its
#: rate loop is much faster.
TILT_LAG, YAW_LAG = 1.0 / TILT.kp, 1.0 / HEADING.kp


def lags(parameters: QuadrotorParameters) -> tuple[float, float, float]:
    """Return the first-order lags of roll, pitch and yaw rate of a vehicle, s."""
    roll, pitch, yaw = parameters.roll_lag, parameters.pitch_lag, parameters.yaw_lag
    return (
        TILT_LAG if roll is None else roll,
        TILT_LAG if pitch is None else pitch,
        YAW_LAG if yaw is None else yaw,
    )


class FirstOrderQuadrotor(Dynamics):
    """The lags, the motors' lag and the drag (linear, as in hover) of a vehicle.

    The model does not contain the vehicle's delay: the caller, which stores the controls, delays
    them. Thrust is over the vehicle's own mass: 9.81 hovers.
    """

    x_dim = 11

    def __init__(self, parameters: QuadrotorParameters):
        self._lags = lags(parameters)
        self._motor_lag = parameters.motor_time_constant
        self._drag = parameters.drag_rates

    def initial_state(self, position: Sequence[Number]) -> Vector[Number]:
        """See `Dynamics.initial_state`; in the air the rotors carry the vehicle."""
        x, y, z = position
        return [x, y, z] + [0.0] * 7 + [where(z > 0.0, GRAVITY**0.5, 0.0)]

    def rates(self, t: float, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        """See `Dynamics.rates`."""
        _, _, _, vx, vy, vz, roll, pitch, yaw, yaw_dot, root = x
        roll_set, pitch_set, yaw_dot_set, thrust = u
        roll_lag, pitch_lag, yaw_lag = self._lags
        horizontal, vertical = self._drag
        ax, ay, az = coupled_acceleration([roll, pitch, yaw_dot, root * root], yaw)
        return [
            vx,
            vy,
            vz,
            ax - horizontal * vx,
            ay - horizontal * vy,
            az - vertical * vz,
            (roll_set - roll) / roll_lag,
            (pitch_set - pitch) / pitch_lag,
            yaw_dot,
            (yaw_dot_set - yaw_dot) / yaw_lag,
            (functions(thrust).sqrt(thrust) - root) / self._motor_lag,
        ]

    def apply_ground_contact(self, x: Vector[Number]) -> Vector[Number]:
        """See `Dynamics.apply_ground_contact`: a vehicle on the ground is upright and at rest."""
        on_ground = x[2] <= 0.0
        climb = where(x[5] > 0.0, x[5], 0.0)
        standing = [x[0], x[1], 0.0, 0.0, 0.0, climb, 0.0, 0.0, x[8], 0.0, x[10]]
        return [where(on_ground, after, before) for after, before in zip(standing, x, strict=True)]

    @override
    def pose(self, x: Sequence[float], u: Sequence[float]) -> tuple[Triple, Quaternion]:
        return (x[0], x[1], x[2]), quaternion_from_zyx(x[6], x[7], x[8])
