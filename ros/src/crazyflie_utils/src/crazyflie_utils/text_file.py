"""Files that users name; text files in UTF-8, of limited size."""

import os
from collections.abc import Callable
from pathlib import Path

from crazyflie_utils.text import shortened

MAX_SIZE = 10_000_000  #: Largest text file (bytes).


class TextFileError(Exception):
    """A file is not a text; ``line`` is the number of the line at fault, from 1, or None."""

    def __init__(self, reason: str, line: int | None = None):
        super().__init__(reason)
        self.line = line


def user_path(path: str | Path) -> Path:
    """Return the path of a file that a user names: ~ is the home folder, also where no shell is."""
    return Path(os.path.expanduser(path))


def _content(path: str, most: int) -> bytes:
    with open(user_path(path), "rb") as file:
        return file.read(most)


#: ``content(path, most)`` returns the first bytes of a file, see `user_path`; a journal keeps what
#: it has returned by the path as it is given.
content: Callable[[str, int], bytes] = _content


def read_text(path: str | Path, max_size: int = MAX_SIZE) -> str:
    """Return the text of a file in UTF-8, without a byte order mark; see `user_path`.

    `TextFileError`: it cannot be read, is longer than ``max_size`` bytes, is not in UTF-8, or has a
    NUL.
    """
    try:
        data = content(str(path), max_size + 1)
    except (FileNotFoundError, NotADirectoryError) as error:
        place = os.path.abspath(user_path(path))
        hint = "" if place == str(path) else f"; looked for {shortened(place)}"
        raise TextFileError(f"cannot be read: {error.strerror}{hint}") from None
    except OSError as error:
        raise TextFileError(f"cannot be read: {error.strerror}") from None
    except ValueError as error:
        # A path with a NUL.
        raise TextFileError(f"cannot be read: {error}") from None
    if len(data) > max_size:
        raise TextFileError(f"is too long; expected at most {max_size} bytes")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # The bytes that failed are counted without the byte order mark.
        failed = error.object[: error.start]
        line = bytes(failed).count(b"\n") + 1
        raise TextFileError(f"is not text in UTF-8: {error.reason}", line) from None
    before, nul, _ = text.partition("\0")
    if nul:
        raise TextFileError("has a NUL character; expected text", before.count("\n") + 1)
    return text
