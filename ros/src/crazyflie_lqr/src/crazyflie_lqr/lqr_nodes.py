"""LQR controllers by the state that they take: position, velocity and yaw; lift; the full state."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from crazyflie_lqr.gain_file import MatrixFile
from crazyflie_lqr.linear_feedback import THRUST, IntegralStateFeedback
from crazyflie_lqr.linear_feedback_node import LinearFeedbackNode, LinearFeedbackParameters
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_msgs.msg import (
    FullStateStamped,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import Integer, Number


class PositionVelocityYawStateLqrNode(LinearFeedbackNode):
    """Linear feedback to a position, velocity and yaw."""

    state_type = PositionVelocityYawStateStamped
    reference_type = PositionVelocityYawStateStamped
    yaw_index = 6


_TILT_GAIN = Number("rad/(m s)")
_LIMIT = Number("m s", minimum=0.0)


class IntegratorGains(Parameters):
    """Gains of the integral of the position error."""

    x: float = parameter(_TILT_GAIN, "pitch per integral of the error in x", 0.0, live=True)
    y: float = parameter(_TILT_GAIN, "roll per integral of the error in y", 0.0, live=True)
    z: float = parameter(Number("1/s^3"), "thrust per integral of the error in z", 0.0, live=True)


class IntegratorLimits(Parameters):
    """Limits of the integral of the position error."""

    x: float = parameter(_LIMIT, "limit of the integral's magnitude", 0.0, live=True)
    y: float = parameter(_LIMIT, "limit of the integral's magnitude", 0.0, live=True)
    z: float = parameter(_LIMIT, "limit of the integral's magnitude", 0.0, live=True)


_TILT = Number("rad", above=0.0, maximum=MAX_TILT)
_THRUST = Number("m/s^2", minimum=MIN_THRUST, maximum=MAX_THRUST)


class ControlLimits(Parameters):
    """Limits of the control, within those of every controller."""

    max_roll: float = parameter(_TILT, "largest roll to either side", MAX_TILT, live=True)
    max_pitch: float = parameter(_TILT, "largest pitch to either side", MAX_TILT, live=True)
    max_thrust: float = parameter(_THRUST, "largest thrust", MAX_THRUST, live=True)
    min_thrust: float = parameter(_THRUST, "smallest thrust", MIN_THRUST, live=True)


class LiftLqrParameters(LinearFeedbackParameters):
    """Parameters of `PositionVelocityYawStateLiftLqrNode`."""

    integrator_k: IntegratorGains = group(IntegratorGains, "integrator/k")
    integrator_limit: IntegratorLimits = group(IntegratorLimits, "integrator/thresh")
    limit: ControlLimits = group(ControlLimits, "control")

    @override
    def complaints(self) -> Iterator[str]:
        yield from super().complaints()
        lowest, hover, highest = self.limit.min_thrust, self.u_ref[THRUST], self.limit.max_thrust
        if not lowest < hover < highest:
            yield (
                f"control/min_thrust ... control/max_thrust is {lowest:g} ... {highest:g} m/s^2; "
                f"expected {hover:g}, the thrust of u_ref_file, between them"
            )


class PositionVelocityYawStateLiftLqrNode(LinearFeedbackNode):
    """Saturated linear feedback with an integrator, to a position and velocity at yaw 0."""

    state_type = PositionVelocityYawStateStamped
    reference_type = PositionVelocityStateStamped
    parameters_type = LiftLqrParameters
    yaw_index = 6
    # The reference has no yaw; it is 0.
    reference_tail: tuple[float, ...] = (0.0,)

    @override
    def make_controller(self, parameters: LiftLqrParameters) -> IntegralStateFeedback:
        k, limit, control = parameters.integrator_k, parameters.integrator_limit, parameters.limit
        return IntegralStateFeedback(
            parameters.K,
            parameters.u_ref,
            self.yaw_index,
            (k.x, k.y, k.z),
            (limit.x, limit.y, limit.z),
            (
                (-control.max_roll, control.max_roll),
                (-control.max_pitch, control.max_pitch),
                (-math.inf, math.inf),
                (control.min_thrust, control.max_thrust),
            ),
        )


class FullStateLqrParameters(LinearFeedbackParameters):
    """Parameters of `FullStateLqrNode`."""

    x_dim: int = parameter(Integer(12, 12), "length of the state")
    K: NDArray[np.float64] = parameter(
        MatrixFile(4, 12), "gain file, `u_dim` rows of `x_dim` numbers", name="K_file", live=True
    )


class FullStateLqrNode(LinearFeedbackNode):
    """Linear feedback to a full state.

    Roll and pitch are taken as the state has them, about the axes of the fixed
    frame; see the package's README for what that means for the gains.
    """

    state_type = FullStateStamped
    reference_type = FullStateStamped
    parameters_type = FullStateLqrParameters
    yaw_index = 8
