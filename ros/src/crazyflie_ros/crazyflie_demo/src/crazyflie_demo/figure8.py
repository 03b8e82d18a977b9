"""The figure eight of ``data/figure8.csv``.

A Lissajous curve, x = WIDTH sin(phase), y = HEIGHT sin(2 phase), z = 0, yaw = 0, run through once.
The phase begins at rest, reaches a constant rate after `RAMP`, and ends at rest; its rate follows
`minimum_jerk`, so that position, velocity, acceleration and jerk are continuous, and the last three
zero at both ends. Between knots `PIECE` apart the curve is the polynomial of the 7th degree that
shares all four with it at both knots.

Create the file again with ``python3 -m crazyflie_demo.figure8 data/figure8.csv``.
"""

import math
import sys

import numpy as np
from numpy.typing import NDArray

from crazyflie_demo.trajectory_file import save
from crazyflie_model.polynomials import COEFFICIENTS, PolynomialPiece, evaluate, hermite

WIDTH, HEIGHT = 0.75, 0.375  #: Amplitudes along x and y, m.
DURATION, RAMP, PIECE = 10.0, 2.0, 1.0  #: s.
_RATE = 2.0 * math.pi / (DURATION - RAMP)  #: Rate of the phase between the ramps (rad/s).
#: Coefficients of `crazyflie_model.trajectory.minimum_jerk`, by powers of s.
_RAMP_INTEGRAL = (0.0, 0.0, 0.0, 0.0, 2.5, -3.0, 1.0)


def phase(time: float) -> NDArray[np.float64]:
    """Return the phase and its first three derivatives, shape (4,), at a time (s)."""
    if time > DURATION - RAMP:
        # The end is the beginning in reverse.
        mirrored = phase(DURATION - time)
        return np.array([2.0 * math.pi, 0.0, 0.0, 0.0]) - [1.0, -1.0, 1.0, -1.0] * mirrored
    s = min(time / RAMP, 1.0)
    ramp = np.array(evaluate(_RAMP_INTEGRAL, s, 3)) * RAMP ** np.array([1.0, 0.0, -1.0, -2.0])
    return _RATE * ramp + [_RATE * max(time - RAMP, 0.0), 0.0, 0.0, 0.0]


def sine(amplitude: float, multiple: int, time: float) -> NDArray[np.float64]:
    """Return amplitude sin(multiple phase) and its first three derivatives, shape (4,)."""
    p, v, a, j = multiple * phase(time)
    sin, cos = math.sin(p), math.cos(p)
    return amplitude * np.array(
        [sin, v * cos, a * cos - v * v * sin, j * cos - 3.0 * v * a * sin - v**3 * cos]
    )


def figure8() -> list[PolynomialPiece]:
    """Return the pieces of the figure eight."""
    knots: list[float] = np.arange(0.0, DURATION + PIECE / 2.0, PIECE).tolist()
    pieces = []
    for begin, end in zip(knots, knots[1:], strict=False):
        x, y = (
            hermite(sine(*axis, begin).tolist(), sine(*axis, end).tolist(), PIECE)
            for axis in ((WIDTH, 1), (HEIGHT, 2))
        )
        zero = (0.0,) * COEFFICIENTS
        pieces.append(PolynomialPiece(PIECE, x, y, zero, zero))
    return pieces


if __name__ == "__main__":
    save(sys.argv[1], figure8())
