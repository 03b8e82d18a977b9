"""The firmware's console: text that comes in pieces of up to 30 bytes."""

import codecs
from collections.abc import Callable


class Console:
    """Put the pieces together to lines: ``on_line(text)`` is called for each, without its end."""

    def __init__(self, on_line: Callable[[str], None]):
        self._on_line = on_line
        self._decoder = codecs.getincrementaldecoder("utf-8")(errors="replace")
        self._line = ""

    def receive(self, data: bytes) -> None:
        """Take a piece; a character may begin in one and end in the next."""
        *lines, self._line = (self._line + self._decoder.decode(data)).split("\n")
        for line in lines:
            self._on_line(line.rstrip("\r\0"))
