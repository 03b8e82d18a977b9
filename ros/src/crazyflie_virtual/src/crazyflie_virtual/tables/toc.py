"""Tables of contents: what a client can log and set, with names and types."""

import struct
import zlib
from collections.abc import Sequence
from typing import NamedTuple

_ITEM, _INFO = 2, 3


class Entry(NamedTuple):
    """One line of a table.

    Attributes
    ----------
    group, name : str
        Together at most 24 characters: an item is one packet.
    code : int
        Type and flags, a byte.
    """

    group: str
    name: str
    code: int

    def encode(self) -> bytes:
        """Return type and names as they are on the wire."""
        return bytes([self.code]) + self.group.encode() + b"\0" + self.name.encode() + b"\0"


class Table:
    """A numbered list of entries and the answers to questions about it.

    Parameters
    ----------
    entries : sequence of Entry
        In the order of their numbers.
    limits : bytes
        What follows number of entries and checksum in the table's description.
    """

    def __init__(self, entries: Sequence[Entry], limits: bytes = b""):
        self._items = [entry.encode() for entry in entries]
        self._limits = limits
        self._index = {(e.group, e.name): i for i, e in enumerate(entries)}
        self.crc = zlib.crc32(b"".join(self._items))
        """Changes with the table: clients keep tables by it."""

    def index(self, group: str, name: str) -> int | None:
        """Return the number of an entry; None when there is none."""
        return self._index.get((group, name))

    def answer(self, request: bytes) -> bytes | None:
        """Return the answer to a request on the table's channel.

        An item that does not exist is answered with the command alone; an
        unknown command with None.
        """
        if request[:1] == bytes([_INFO]):
            return struct.pack("<BHI", _INFO, len(self._items), self.crc) + self._limits
        if request[:1] == bytes([_ITEM]) and len(request) >= 3:
            (index,) = struct.unpack_from("<H", request, 1)
            if index < len(self._items):
                return request[:3] + self._items[index]
            return request[:1]
        return None
