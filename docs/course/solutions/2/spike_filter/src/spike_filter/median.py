"""The algorithm: numbers only, no ROS."""

import statistics
from collections import deque


class Median:
    """Median of the last numbers: a single wrong one leaves no trace.

    Parameters
    ----------
    window : int
        How many numbers.
    """

    def __init__(self, window: int):
        self._numbers: deque[float] = deque(maxlen=window)

    def add(self, number: float) -> float:
        """Take a number; return the median of it and those before it in the window."""
        self._numbers.append(number)
        return statistics.median(self._numbers)

    def reset(self) -> None:
        """Forget all numbers."""
        self._numbers.clear()
