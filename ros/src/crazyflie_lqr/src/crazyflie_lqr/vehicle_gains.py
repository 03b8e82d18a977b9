"""Gains for a vehicle with a model: as fast as its delay and its lags allow."""

import numpy as np
from numpy.typing import NDArray

from crazyflie_lqr.design import Design, DesignError, Weights, design_gains
from crazyflie_lqr.margins import FLOWN_PERIOD, Margins, all_margins, flown
from crazyflie_lqr.models import near_hover, vehicle_plant
from crazyflie_model.first_order_quadrotor import lags
from crazyflie_model.quadrotor import QuadrotorParameters
from crazyflie_model.units import GRAVITY

#: Bandwidth of a position loop times the time by which its control comes late: delay, lag and the
#: half period of sampling and difference. The loops then have a modulus margin of about 0.5.
PACE = 0.42
DAMPING = 0.9  #: Damping ratio of the position loops.
#: Largest bandwidths, rad/s, horizontal, vertical and of yaw: noise of poses is not to shake the
#: vehicle.
MAX_BANDWIDTH = (3.5, 4.0, 5.0)
#: Least delay margin of a loop beyond the vehicle's delay (s), and least distance of the loop from
#: -1.
LEAST_DELAY, LEAST_MODULUS = 0.03, 0.4

_SLOWER = 0.85  #: Factor of the bandwidths for the next attempt.


def weights(model: QuadrotorParameters, pace: float = PACE) -> Weights:
    """Return the weights of a cost whose minimum has these bandwidths and `DAMPING`.

    For the model `near_hover`, of double integrators, the gains of least cost are known in closed
    form: from the wanted ones follow the weights, with those of the controls 1.
    """
    late = model.delay + FLOWN_PERIOD
    roll, pitch, yaw = lags(model)
    limits = MAX_BANDWIDTH
    tilt, climb, turn = (
        min(pace / (late + lag), limit)
        for lag, limit in zip(
            (max(roll, pitch), model.motor_time_constant, yaw), limits, strict=True
        )
    )
    extra = 4.0 * DAMPING**2 - 2.0
    horizontal, speed = (tilt**2 / GRAVITY) ** 2, extra * (tilt / GRAVITY) ** 2
    Q = np.diag([horizontal] * 2 + [climb**4] + [speed] * 2 + [extra * climb**2, turn**2])
    return Weights(Q, np.eye(4), np.zeros((7, 4)))


def design(model: QuadrotorParameters) -> tuple[Design, list[Margins]]:
    """Return gains for a vehicle, and the margins of the loops as they are flown.

    `DesignError`: the vehicle's delay is too long for any gains.
    """
    plant, states = vehicle_plant(model), near_hover()
    pace = PACE
    while pace > 0.05:
        found = design_gains(states, weights(model, pace))
        loops = all_margins(flown(found.K, states.states, plant, delay=model.delay))
        least = min(loop.delay for loop in loops)
        if least >= LEAST_DELAY and min(loop.modulus for loop in loops) >= LEAST_MODULUS:
            return found, loops
        pace *= _SLOWER
    raise DesignError(
        f"no gains tolerate a delay of {1e3 * model.delay:g} ms and lags of "
        f"{', '.join(f'{1e3 * each:.0f}' for each in lags(model))} ms"
    )


def gains(model: QuadrotorParameters) -> NDArray[np.float64]:
    """Return the gains of `design`, shape (4, 7)."""
    return design(model)[0].K
