"""Velocities that depend on a position, or on chance."""

import math
import random

from crazyflie_utils.refusal import RefusalError

OSCILLATOR_BEGIN = 2.0
OSCILLATOR_END = 9.0  #: Where the oscillator has a velocity: from begin to end, both included.

OSCILLATOR_LENGTH = OSCILLATOR_END - OSCILLATOR_BEGIN


def oscillator_velocity(x: float) -> float:
    """Return the velocity of a harmonic oscillator: slow at both ends, fast in the middle.

    vel = 0.1 + 2 sin(pi x / 7 - 2 pi / 7), from an exercise of the course Robot Programming with
    ROS (C. T. Recchiuto, Genova). The summand 0.1 is what makes it leave its ends.

    Parameters
    ----------
    x : float
        From 2 to 9.

    Returns
    -------
    float
        From 0.1 to 2.1, in units of ``x`` per second.

    Raises
    ------
    RefusalError
        ``x`` is outside, or no number.
    """
    if not OSCILLATOR_BEGIN <= x <= OSCILLATOR_END:
        raise RefusalError(f"x is {x:g}; expected {OSCILLATOR_BEGIN:g} to {OSCILLATOR_END:g}")
    return 0.1 + 2.0 * math.sin(math.pi * (x - OSCILLATOR_BEGIN) / OSCILLATOR_LENGTH)


def random_velocities(least: float, most: float, source: random.Random) -> tuple[float, float]:
    """Return two velocities, each uniformly distributed in an interval.

    Raises
    ------
    RefusalError
        The interval is empty or not finite.
    """
    if not (math.isfinite(least) and math.isfinite(most) and least <= most):
        raise RefusalError(f"min is {least:g}, max is {most:g}; expected finite min <= max")
    return source.uniform(least, most), source.uniform(least, most)
