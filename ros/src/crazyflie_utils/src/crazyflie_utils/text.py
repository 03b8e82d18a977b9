"""Values and names in messages; numbers in texts."""

import re
import reprlib

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


DECIMAL = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"  #: Pattern: 7, 010, .5, 1e-3.
HEXADECIMAL = r"[+-]?0[xX][0-9a-fA-F]{1,16}"  #: Pattern: 0x07.


def number_from_text(text: str) -> float:
    """Return the number in a text by the common rules: 1e-3, 010 is 10, 0x10 is 16; not 1_000.

    ``nan`` and ``inf`` are numbers that the caller may refuse. ValueError if the text is not a
    number.
    """
    word = text.strip()
    if re.fullmatch(DECIMAL, word) or word.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        return float(word)
    if re.fullmatch(HEXADECIMAL, word):
        return float.fromhex(word)
    raise ValueError(f"{shown(text)} is not a number")
