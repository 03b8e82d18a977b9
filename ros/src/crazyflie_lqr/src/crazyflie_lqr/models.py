"""The vehicle linearised at hover, for which gains are designed.

Deviations from hover at yaw 0: x_dot = A x + B u, in m, m/s, rad and rad/s;
u = (roll, pitch, yaw_dot, thrust) in rad, rad/s and m/s^2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crazyflie_model.first_order_quadrotor import TILT_LAG, lags
from crazyflie_model.quadrotor import QuadrotorParameters
from crazyflie_model.units import GRAVITY

CONTROLS = ("roll", "pitch", "yaw_dot", "thrust")

#: Lag of the measured angular rates in `full_state` (s): they are differences of attitudes 10 ms
#: apart.
RATE_TIME_CONSTANT = 0.01


@dataclass(frozen=True)
class LinearModel:
    """A linear model with named states; A has shape (x_dim, x_dim), B (x_dim, u_dim)."""

    name: str
    states: tuple[str, ...]
    A: NDArray[np.float64]
    B: NDArray[np.float64]

    @property
    def x_dim(self) -> int:
        """Length of the state."""
        return len(self.states)

    @property
    def u_dim(self) -> int:
        """Length of the control."""
        return len(CONTROLS)


def _model(name, rates):
    """Return the model with these time derivatives: state -> {state or u_control: coefficient}."""
    inputs = [*rates, *(f"u_{control}" for control in CONTROLS)]
    matrix = np.array([[rate.get(each, 0.0) for each in inputs] for rate in rates.values()])
    return LinearModel(name, tuple(rates), matrix[:, : len(rates)], matrix[:, len(rates) :])


def near_hover() -> LinearModel:
    """Return the 7-dimensional model: attitude and thrust follow their commands at once.

    It linearises both the near-hover and the coupled 7-dimensional dynamics.
    """
    rates = {
        "x": {"x_dot": 1.0},
        "y": {"y_dot": 1.0},
        "z": {"z_dot": 1.0},
        "x_dot": {"u_pitch": GRAVITY},
        "y_dot": {"u_roll": -GRAVITY},
        "z_dot": {"u_thrust": 1.0},
        "yaw": {"u_yaw_dot": 1.0},
    }
    return _model("near_hover", rates)


def full_state() -> LinearModel:
    """Return the 12-dimensional model: roll and pitch follow with a first-order lag.

    The angular rates are measured, with a lag, and act on nothing: with an
    attitude of first order they follow from attitude and command. With no weight
    on them their gains are therefore zero, and the noise of differentiated
    attitudes stays out of the control.
    """
    follow, measure = 1.0 / TILT_LAG, 1.0 / RATE_TIME_CONSTANT
    both = follow * measure
    rates = {
        "x": {"x_dot": 1.0},
        "y": {"y_dot": 1.0},
        "z": {"z_dot": 1.0},
        "x_dot": {"pitch": GRAVITY},
        "y_dot": {"roll": -GRAVITY},
        "z_dot": {"u_thrust": 1.0},
        "roll": {"u_roll": follow, "roll": -follow},
        "pitch": {"u_pitch": follow, "pitch": -follow},
        "yaw": {"u_yaw_dot": 1.0},
        "roll_dot": {"u_roll": both, "roll": -both, "roll_dot": -measure},
        "pitch_dot": {"u_pitch": both, "pitch": -both, "pitch_dot": -measure},
        "yaw_dot": {"u_yaw_dot": measure, "yaw_dot": -measure},
    }
    return _model("full_state", rates)


def vehicle_plant(model: QuadrotorParameters) -> LinearModel:
    """Return a vehicle with its lags and its drag, without its delay.

    ``turn`` is the yaw rate, ``lift`` the thrust over the mass above that of hover.
    """
    roll, pitch, yaw = (1.0 / lag for lag in lags(model))
    motor = 1.0 / model.motor_time_constant
    horizontal, vertical = model.drag_rates
    rates = {
        "x": {"x_dot": 1.0},
        "y": {"y_dot": 1.0},
        "z": {"z_dot": 1.0},
        "x_dot": {"pitch": GRAVITY, "x_dot": -horizontal},
        "y_dot": {"roll": -GRAVITY, "y_dot": -horizontal},
        "z_dot": {"lift": 1.0, "z_dot": -vertical},
        "yaw": {"turn": 1.0},
        "roll": {"u_roll": roll, "roll": -roll},
        "pitch": {"u_pitch": pitch, "pitch": -pitch},
        "turn": {"u_yaw_dot": yaw, "turn": -yaw},
        "lift": {"u_thrust": motor, "lift": -motor},
    }
    return _model("vehicle", rates)


#: Name -> function that returns the model.
MODELS = {"near_hover": near_hover, "full_state": full_state}
