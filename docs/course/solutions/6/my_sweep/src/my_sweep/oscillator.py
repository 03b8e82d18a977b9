"""Step 1: the velocity of a harmonic oscillator, and its scale."""

import math

from crazyflie_utils.refusal import RefusalError

BEGIN, END = 2.0, 9.0


def velocity(x: float) -> float:
    """Return 0.1 + 2 sin(pi (x - 2) / 7): slow at both ends, fast in the middle.

    Parameters
    ----------
    x : float
        From 2 to 9.

    Returns
    -------
    float
        In units of ``x`` per second.

    Raises
    ------
    RefusalError
        ``x`` is outside, or no number. The text is "x is 1.5; expected 2 to 9".
    """
    if not BEGIN <= x <= END:
        raise RefusalError(f"x is {x:g}; expected {BEGIN:g} to {END:g}")
    return 0.1 + 2.0 * math.sin(math.pi * (x - BEGIN) / (END - BEGIN))


def service_position(x: float, x_min: float, x_max: float) -> float:
    """Return where x (m) is on the oscillator's scale: x_min is 2, x_max is 9.

    What is beyond an end of the lane, such as an arc, is at that end.
    """
    share = (x - x_min) / (x_max - x_min)
    return BEGIN + (END - BEGIN) * min(max(share, 0.0), 1.0)
