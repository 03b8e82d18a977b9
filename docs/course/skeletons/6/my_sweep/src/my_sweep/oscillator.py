"""Step 1: the velocity of a harmonic oscillator."""

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
        ``x`` is outside.
    """
    raise NotImplementedError("step 1")
