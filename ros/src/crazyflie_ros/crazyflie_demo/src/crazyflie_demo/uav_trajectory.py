"""Polynomial trajectories and their body rates; users' scripts import it as uav_trajectory."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

from crazyflie_demo.trajectory_file import load, save
from crazyflie_model.angles import rotate_by_yaw
from crazyflie_model.polynomials import PolynomialPiece, evaluate
from crazyflie_model.units import GRAVITY

Array = NDArray[np.float64]


@dataclass
class TrajectoryOutput:
    """A trajectory at a moment; a script may make one without arguments, and fill it.

    Position (m), velocity (m/s), acceleration (m/s^2), jerk (m/s^3) and snap (m/s^4) in the world
    frame, angular velocity in the body frame (forward-left-up, rad/s), each of shape (3,); yaw,
    roll and pitch (rad), of the attitude ``Rz(yaw) Ry(pitch) Rx(roll)`` with the thrust along z.
    """

    pos: Any = None
    vel: Any = None
    acc: Any = None
    omega: Any = None
    yaw: Any = None
    jerk: Any = None
    snap: Any = None
    roll: Any = None
    pitch: Any = None


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

    def stretchtime(self, factor: float) -> None:
        """Take the values of times t at times factor * t."""
        self.p = self.p / float(factor) ** np.arange(len(self.p))


class Polynomial4D:
    """A piece of a trajectory: polynomials for x, y, z (m) and yaw (rad) of the time (s) in it.

    They are given by their coefficients, at most eight each, and kept as `Polynomial`.
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
        return Polynomial4D(self.duration, *(axis.derivative().p for axis in self._axes()))

    def stretchtime(self, factor: float) -> None:
        """Make the piece take ``factor`` times as long, on the same path."""
        for axis in self._axes():
            axis.stretchtime(factor)
        self.duration *= factor

    def _axes(self):
        return self.px, self.py, self.pz, self.pyaw

    def eval(self, t: float) -> TrajectoryOutput:
        """Return the piece at a time ``t`` (s) from its beginning."""
        axes = [evaluate(axis.p, t, 4) for axis in (self.px, self.py, self.pz)]
        position, velocity, acceleration, jerk, snap = np.array(axes).T
        yaw, yaw_rate = map(float, evaluate(self.pyaw.p, t, 1))
        omega = angular_velocity(acceleration, jerk, yaw, yaw_rate)
        # Specific thrust ahead, to the left and up, for the heading.
        x, y, z = acceleration.tolist()
        ahead, left = rotate_by_yaw(x, y, -yaw)
        up = z + GRAVITY
        return TrajectoryOutput(
            position,
            velocity,
            acceleration,
            omega,
            yaw,
            jerk,
            snap,
            roll=-math.atan2(left, math.hypot(ahead, up)),
            pitch=math.atan2(ahead, up),
        )


class Trajectory:
    """Pieces, one after the other, and the duration (s) of all."""

    def __init__(self) -> None:
        self.polynomials: list[Polynomial4D] = []
        self.duration = 0.0

    def n_pieces(self) -> int:
        """Return the number of pieces."""
        return len(self.polynomials)

    def loadcsv(self, filename: str | Path, skip_header: bool = True) -> None:
        """Load a file; raises `TrajectoryError`, see `crazyflie_demo.trajectory_file.load`.

        A first line without numbers is a heading, whatever ``skip_header`` is.
        """
        self.polynomials = [Polynomial4D(piece.duration, *piece.axes) for piece in load(filename)]
        self.duration = sum(piece.duration for piece in self.polynomials)

    def savecsv(self, filename: str | Path) -> None:
        """Write a file that `loadcsv` reads."""
        pieces = (
            PolynomialPiece(piece.duration, *(axis.p.tolist() for axis in piece._axes()))
            for piece in self.polynomials
        )
        save(filename, list(pieces))

    def stretchtime(self, factor: float) -> None:
        """Make the trajectory take ``factor`` times as long, on the same path."""
        if not factor > 0.0:
            raise ValueError(f"factor is {factor}; expected a number > 0")
        for piece in self.polynomials:
            piece.stretchtime(factor)
        self.duration *= factor

    def eval(self, t: float) -> TrajectoryOutput:
        """Return the trajectory at a time ``t`` (s), 0 to `duration`; otherwise `ValueError`."""
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

    Acceleration (m/s^2) and jerk (m/s^3) are of shape (3,), in the world frame; yaw and its rate
    in rad and rad/s. The result, of shape (3,), is in the body frame (forward-left-up), rad/s; NaN
    in free fall, and with the body's x axis vertical, where it is not defined.
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
