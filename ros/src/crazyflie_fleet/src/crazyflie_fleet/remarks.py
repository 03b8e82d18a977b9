"""Remarks on a fleet file: what is passed over, and what has no effect."""

import difflib
from collections.abc import Iterable

from crazyflie_utils.parameters.yaml_file import Entry

#: How much an unknown key resembles a known one that it is a misspelling of, 0 to 1.
_SIMILAR = 0.8


class Remarks:
    """Collects remarks; those on the keys of one kind become one line."""

    def __init__(self) -> None:
        self._texts: dict[object, str] = {}
        self._unknown: dict[str, list[int]] = {}
        self._idle: dict[str, list[int]] = {}
        self._file: object = ""

    def add(self, text: str, key: object = None) -> None:
        """Note a text; only the first one with the same key, which is by default the text."""
        self._texts.setdefault(key or text, text)

    def unknown(self, entry: Entry, known: Iterable[str]) -> None:
        """Note an entry with a key that is not known.

        Raises
        ------
        ParameterError
            It is a known one, misspelt.
        """
        key = entry.name.rpartition("/")[2]
        words = {word for name in known for word in name.split("/")}
        if meant := difflib.get_close_matches(key, words, 1, _SIMILAR):
            raise entry.error(f"is not known; expected {meant[0]}")
        self._note(self._unknown, key, entry)

    def idle(self, entry: Entry, key: str) -> None:
        """Note an entry of a known key that has no effect."""
        self._note(self._idle, key, entry)

    def texts(self) -> tuple[str, ...]:
        """Return all remarks."""
        texts = [*self._texts.values()]
        if self._unknown:
            texts.append(f"{self._file}: passed over, as not known here: {_listed(self._unknown)}")
        texts += [
            f"{self._file}: {_listed({key: lines})} has no effect here"
            for key, lines in self._idle.items()
        ]
        return tuple(texts)

    def _note(self, found, key, entry):
        self._file = entry.file
        lines = found.setdefault(key, [])
        if entry.line not in lines:
            lines.append(entry.line)


def _listed(found):
    return "; ".join(f"{key} (line {', '.join(map(str, lines))})" for key, lines in found.items())
