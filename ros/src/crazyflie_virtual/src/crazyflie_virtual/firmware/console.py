"""What the firmware prints."""

from collections import deque

from crazyflie_virtual.link.crtp import MAX_DATA

_KEPT = 100
"""Pieces kept until a client reads them."""


class Console:
    """Text on its way to the client.

    What is printed before there is a client is kept, the latest of it.
    """

    def __init__(self) -> None:
        self._pieces: deque[bytes] = deque(maxlen=_KEPT)

    def write_line(self, line: str) -> None:
        """Print a line."""
        data = (line + "\n").encode("ascii", "replace")
        self._pieces.extend(data[i : i + MAX_DATA] for i in range(0, len(data), MAX_DATA))

    def pop(self) -> bytes | None:
        """Return the next piece, at most a packet long; None when there is none."""
        return self._pieces.popleft() if self._pieces else None
