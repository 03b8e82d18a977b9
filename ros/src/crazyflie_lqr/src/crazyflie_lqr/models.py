"""The vehicle linearised at hover, which is what gains are designed for.

Deviations from hover at yaw 0: x_dot = A x + B u, in m, m/s, rad and rad/s;
u = (roll, pitch, yaw_dot, thrust) in rad, rad/s and m/s^2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crazyflie_model import inner_loops
from crazyflie_model.units import GRAVITY

CONTROLS = ("roll", "pitch", "yaw_dot", "thrust")

ATTITUDE_TIME_CONSTANT = 1.0 / inner_loops.TILT.kp
"""How roll and pitch of the vehicle follow their commands in `full_state`, s: the
firmware's attitude loop turns an error into a rate, and its rate loop is much
faster."""

RATE_TIME_CONSTANT = 0.01
"""Lag of the measured angular rates in `full_state`, s: they are differences of
attitudes 10 ms apart."""


@dataclass(frozen=True)
class LinearModel:
    """A linear model with named states.

    Attributes
    ----------
    name : str
    states : tuple of str
    A : ndarray, shape (x_dim, x_dim)
    B : ndarray, shape (x_dim, u_dim)
    """

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


class _Builder:
    """Fills in A and B by the names of states and controls."""

    def __init__(self, name: str, states: tuple[str, ...]):
        self._name = name
        self._states = states
        self._A = np.zeros((len(states), len(states)))
        self._B = np.zeros((len(states), len(CONTROLS)))

    def rate(self, of, **coefficients):
        """Set the time derivative of a state: state or ``u_`` control = coefficient."""
        row = self._states.index(of)
        for name, coefficient in coefficients.items():
            if name.startswith("u_"):
                self._B[row, CONTROLS.index(name[2:])] = coefficient
            else:
                self._A[row, self._states.index(name)] = coefficient

    def model(self):
        return LinearModel(self._name, self._states, self._A, self._B)


def near_hover() -> LinearModel:
    """Return the 7-dimensional model: attitude and thrust follow their commands at once.

    The near-hover and the coupled 7-dimensional dynamics have this
    linearisation in common.
    """
    states = ("x", "y", "z", "x_dot", "y_dot", "z_dot", "yaw")
    builder = _Builder("near_hover", states)
    for axis in "xyz":
        builder.rate(axis, **{f"{axis}_dot": 1.0})
    builder.rate("x_dot", u_pitch=GRAVITY)
    builder.rate("y_dot", u_roll=-GRAVITY)
    builder.rate("z_dot", u_thrust=1.0)
    builder.rate("yaw", u_yaw_dot=1.0)
    return builder.model()


def full_state() -> LinearModel:
    """Return the 12-dimensional model: roll and pitch follow with a first-order lag.

    The angular rates are measured, with a lag, and act on nothing: with an
    attitude of first order they follow from attitude and command. With no weight
    on them their gains are therefore zero, and the noise of differentiated
    attitudes stays out of the control.
    """
    translation = ("x", "y", "z", "x_dot", "y_dot", "z_dot")
    states = (*translation, "roll", "pitch", "yaw", "roll_dot", "pitch_dot", "yaw_dot")
    builder = _Builder("full_state", states)
    for axis in "xyz":
        builder.rate(axis, **{f"{axis}_dot": 1.0})
    builder.rate("x_dot", pitch=GRAVITY)
    builder.rate("y_dot", roll=-GRAVITY)
    builder.rate("z_dot", u_thrust=1.0)
    builder.rate("yaw", u_yaw_dot=1.0)
    builder.rate("yaw_dot", u_yaw_dot=1.0 / RATE_TIME_CONSTANT, yaw_dot=-1.0 / RATE_TIME_CONSTANT)
    for angle in ("roll", "pitch"):
        follow = 1.0 / ATTITUDE_TIME_CONSTANT
        builder.rate(angle, **{f"u_{angle}": follow, angle: -follow})
        measure = 1.0 / RATE_TIME_CONSTANT
        builder.rate(
            f"{angle}_dot",
            **{
                f"u_{angle}": follow * measure,
                angle: -follow * measure,
                f"{angle}_dot": -measure,
            },
        )
    return builder.model()


MODELS = {"near_hover": near_hover, "full_state": full_state}
"""Name -> function that returns the model."""
