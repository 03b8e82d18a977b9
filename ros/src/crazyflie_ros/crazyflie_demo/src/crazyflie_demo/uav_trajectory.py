"""Trajectories of polynomials, with what a vehicle has to do to fly them.

Users' scripts know these classes as ``uav_trajectory``.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

from crazyflie_demo.trajectory_file import load
from crazyflie_model.polynomials import evaluate
from crazyflie_model.units import GRAVITY

Array = NDArray[np.float64]


class TrajectoryOutput(NamedTuple):
    """What a trajectory asks for at some moment.

    Attributes
    ----------
    pos, vel, acc : ndarray, shape (3,)
        In the world frame: m, m/s, m/s^2.
    omega : ndarray, shape (3,)
        Angular velocity in the body frame (forward-left-up), rad/s.
    yaw : float
        rad.
    """

    pos: Array
    vel: Array
    acc: Array
    omega: Array
    yaw: float


class Polynomial:
    """A polynomial; ``p`` are its coefficients, the constant first."""

    def __init__(self, p: ArrayLike):
        self.p = np.asarray(p, dtype=float)

    def eval(self, t: float) -> float:
        """Return its value at t."""
        return float(evaluate(self.p, t, 0)[0])

    def derivative(self) -> "Polynomial":
        """Return its derivative."""
        return Polynomial(polynomial.polyder(self.p))


class Polynomial4D:
    """A piece of a trajectory: polynomials for x, y, z (m) and yaw (rad) of the time in it.

    Parameters
    ----------
    duration : float
        s.
    px, py, pz, pyaw : array_like
        Coefficients, at most eight each; kept as `Polynomial`.
    """

    def __init__(
        self, duration: float, px: ArrayLike, py: ArrayLike, pz: ArrayLike, pyaw: ArrayLike
    ):
        self.duration = duration
        self.px = Polynomial(px)
        self.py = Polynomial(py)
        self.pz = Polynomial(pz)
        self.pyaw = Polynomial(pyaw)

    def derivative(self) -> "Polynomial4D":
        """Return the piece's velocity, as another piece."""
        axes = (self.px, self.py, self.pz, self.pyaw)
        return Polynomial4D(self.duration, *(axis.derivative().p for axis in axes))

    def eval(self, t: float) -> TrajectoryOutput:
        """Return what the piece asks for ``t`` (s) after its beginning."""
        axes = [evaluate(axis.p, t, 3) for axis in (self.px, self.py, self.pz)]
        position, velocity, acceleration, jerk = np.array(axes).T
        yaw, yaw_rate = map(float, evaluate(self.pyaw.p, t, 1))
        omega = angular_velocity(acceleration, jerk, yaw, yaw_rate)
        return TrajectoryOutput(position, velocity, acceleration, omega, yaw)


class Trajectory:
    """Pieces, one after the other.

    Attributes
    ----------
    polynomials : list of Polynomial4D
    duration : float
        Of all of them, s.
    """

    def __init__(self) -> None:
        self.polynomials: list[Polynomial4D] = []
        self.duration = 0.0

    def loadcsv(self, filename: str | Path) -> None:
        """Take the pieces of a file.

        Raises
        ------
        TrajectoryError
            It holds no trajectory that can be flown; see `crazyflie_demo.trajectory_file`.
        """
        self.polynomials = [Polynomial4D(piece.duration, *piece.axes) for piece in load(filename)]
        self.duration = sum(piece.duration for piece in self.polynomials)

    def eval(self, t: float) -> TrajectoryOutput:
        """Return what the trajectory asks for ``t`` (s) after its beginning, 0 to `duration`.

        Raises
        ------
        ValueError
            It is not in progress then.
        """
        if not self.polynomials or not 0.0 <= t <= self.duration:
            raise ValueError(f"t is {t:g} s; the trajectory takes 0 to {self.duration:g} s")
        for piece in self.polynomials[:-1]:
            if t < piece.duration:
                return piece.eval(t)
            t -= piece.duration
        last = self.polynomials[-1]
        return last.eval(min(t, last.duration))


def angular_velocity(acceleration: Array, jerk: Array, yaw: float, yaw_rate: float) -> Array:
    """Return the angular velocity of a multirotor on a trajectory, by differential flatness.

    Mellinger and Kumar, Minimum Snap Trajectory Generation and Control for Quadrotors
    (ICRA 2011), with thrust along the body's z axis, and x axis and heading in one vertical
    plane. Its third component is theirs: the part of the yaw rate along that axis.

    Parameters
    ----------
    acceleration, jerk : ndarray, shape (3,)
        In the world frame: m/s^2, m/s^3.
    yaw, yaw_rate : float
        rad, rad/s.

    Returns
    -------
    ndarray, shape (3,)
        In the body frame (forward-left-up), rad/s. In free fall, and with the body's x axis
        vertical, it is not defined: NaN.
    """
    thrust = acceleration + [0.0, 0.0, GRAVITY]
    heading = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    with np.errstate(invalid="ignore", divide="ignore"):
        magnitude = np.linalg.norm(thrust)
        z_body = thrust / magnitude
        y_body = np.cross(z_body, heading)
        y_body /= np.linalg.norm(y_body)
        x_body = np.cross(y_body, z_body)
        turn = (jerk - (z_body @ jerk) * z_body) / magnitude
    return np.array([-turn @ y_body, turn @ x_body, z_body[2] * yaw_rate])
