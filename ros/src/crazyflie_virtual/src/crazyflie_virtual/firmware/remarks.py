"""Lines on the console about what a client has done in vain."""

from collections.abc import Callable, Hashable

_INTERVAL = 1.0
"""Between two lines of one kind, s."""


class Remarks:
    """Prints, but no flood.

    Parameters
    ----------
    write_line : callable
        ``write_line(text)`` prints a line.
    time : callable
        ``time()`` returns the time, s.
    """

    def __init__(self, write_line: Callable[[str], None], time: Callable[[], float]):
        self._write_line = write_line
        self._time = time
        self._last: dict[Hashable, float] = {}

    def __call__(self, kind: Hashable, text: str) -> bool:
        """Print a line, unless there was one of its kind within the last second.

        Returns
        -------
        bool
            Whether it was printed.
        """
        now = self._time()
        if now - self._last.get(kind, -_INTERVAL) < _INTERVAL:
            return False
        self._last[kind] = now
        self._write_line(text)
        return True
