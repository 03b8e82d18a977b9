"""The polynomial with given derivatives at both ends."""

from collections.abc import Sequence

from scipy.interpolate import BPoly, PPoly


def hermite(start: Sequence[float], end: Sequence[float], duration: float) -> tuple[float, ...]:
    """Return the coefficients, the constant first, of the polynomial between two ends.

    Parameters
    ----------
    start, end : sequence of float
        Value and derivatives by time; four at both ends make a polynomial of the
        7th degree.
    duration : float
        Time between them, s, > 0.
    """
    bernstein = BPoly.from_derivatives([0.0, duration], [start, end])
    return tuple(PPoly.from_bernstein_basis(bernstein).c[::-1, 0].tolist())
