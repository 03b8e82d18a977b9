"""How values and names appear in messages: short, on one line, whatever they hold."""

import reprlib

_VALUE_LENGTH = 80  #: Characters of a value in a message; an expected list of a few numbers fits.
_NAME_LENGTH = 200  #: Characters of a name, or of a list of names, in a message.


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
    """Return a value as a message shows it: its `repr`, of which a long one is cut.

    The time it takes does not depend on the size of the value.
    """
    return shortened(_REPR.repr(value), _VALUE_LENGTH)


def shortened(text: str, length: int = _NAME_LENGTH) -> str:
    """Return a text of at most ``length`` characters: the middle of a longer one is left out."""
    if len(text) <= length:
        return text
    end = (length - 3) // 2
    return f"{text[: length - 3 - end]}...{text[len(text) - end :]}"
