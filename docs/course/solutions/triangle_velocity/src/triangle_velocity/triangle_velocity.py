"""The algorithm: a velocity that rises and falls in straight lines."""

from crazyflie_utils.refusal import RefusalError

BEGIN, END = 2.0, 9.0
LEAST, MOST = 0.2, 2.0


def triangle_velocity(x: float) -> float:
    """Return a velocity that grows from both ends of a lane to its middle.

    Parameters
    ----------
    x : float
        From 2 to 9, as the sweep mission has it.

    Returns
    -------
    float
        From 0.2 to 2, in units of ``x`` per second.

    Raises
    ------
    RefusalError
        ``x`` is outside, or no number.
    """
    if not BEGIN <= x <= END:
        raise RefusalError(f"x is {x:g}; expected {BEGIN:g} to {END:g}")
    share = 2.0 * min(x - BEGIN, END - x) / (END - BEGIN)
    return LEAST + (MOST - LEAST) * share
