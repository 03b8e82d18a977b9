"""The polynomial with given derivatives at both ends."""

from numpy.typing import ArrayLike
from scipy.interpolate import BPoly, PPoly


def hermite(start: ArrayLike, end: ArrayLike, duration: float) -> tuple[float, ...]:
    """Return the coefficients, the constant first, of the polynomial between two ends.

    Parameters
    ----------
    start, end : array_like, shape (n,)
        Value and derivatives by time; four at both ends make a polynomial of the
        7th degree.
    duration : float
        Time between them, s, > 0.
    """
    bernstein = BPoly.from_derivatives([0.0, duration], [start, end])
    return tuple(PPoly.from_bernstein_basis(bernstein).c[::-1, 0].tolist())
