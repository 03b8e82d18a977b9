"""Values and names in messages; text files, and numbers in them."""

import re
import reprlib
from pathlib import Path

_VALUE_LENGTH = 80  #: Length of a value in a message (characters); a short list fits.
_NAME_LENGTH = 200  #: Length of a name, or of a list of names, in a message (characters).


class _Repr(reprlib.Repr):
    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 4
        self.maxlist = self.maxtuple = self.maxdict = self.maxset = self.maxfrozenset = 10
        self.maxstring = self.maxlong = self.maxother = _VALUE_LENGTH

    def repr_int(self, x: int, level: int) -> str:
        # Python refuses to write integers of more than 4300 digits.
        if x.bit_length() > 4 * _VALUE_LENGTH:
            return f"an integer of {x.bit_length()} bits"
        return repr(x)


_REPR = _Repr()


def shown(value: object) -> str:
    """Return the text of a value for messages: its `repr`, shortened if it is long.

    The time it takes does not depend on the size of the value.
    """
    return shortened(_REPR.repr(value), _VALUE_LENGTH)


def shortened(text: str, length: int = _NAME_LENGTH) -> str:
    """Return a text of at most ``length`` characters: the middle of a longer one is left out."""
    if len(text) <= length:
        return text
    end = (length - 3) // 2
    return f"{text[: length - 3 - end]}...{text[len(text) - end :]}"


MAX_SIZE = 10_000_000  #: Largest text file (bytes).

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


class TextFileError(Exception):
    """A file is not a text; ``line`` is the number of the line at fault, from 1, or None."""

    def __init__(self, reason: str, line: int | None = None):
        super().__init__(reason)
        self.line = line


def read_text(path: str | Path, max_size: int = MAX_SIZE) -> str:
    """Return the text of a file in UTF-8, without a byte order mark.

    `TextFileError`: it cannot be read, is longer than ``max_size`` bytes, is not in UTF-8, or has a
    NUL.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(max_size + 1)
    except OSError as error:
        raise TextFileError(f"cannot be read: {error.strerror}") from None
    except ValueError as error:
        # A path with a NUL.
        raise TextFileError(f"cannot be read: {error}") from None
    if len(content) > max_size:
        raise TextFileError(f"is too long; expected at most {max_size} bytes")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # The bytes that failed are counted without the byte order mark.
        failed = error.object[: error.start]
        line = bytes(failed).count(b"\n") + 1
        raise TextFileError(f"is not text in UTF-8: {error.reason}", line) from None
    before, nul, _ = text.partition("\0")
    if nul:
        raise TextFileError("has a NUL character; expected text", before.count("\n") + 1)
    return text


def number_from_text(text: str) -> float:
    """Return the number in a text by the common rules: 1e-3, but not 1_000.

    ``nan`` and ``inf`` are numbers that the caller may refuse. ValueError if the text is not a
    number.
    """
    word = text.strip()
    if _NUMBER.fullmatch(word) or word.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        return float(word)
    raise ValueError(f"{shown(text)} is not a number")
