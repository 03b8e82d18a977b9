"""Tables of contents: what a client can log and set, with names and types."""

import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence

_ITEM, _INFO = 2, 3


class Table:
    """A numbered list of entries and the answers to questions about it.

    Entries are (group, name, code) in the order of their numbers. Group and name have together at
    most 24 characters: an item is one packet. The code is type and flags, a byte. ``limits`` is
    what follows number of entries and checksum in the table's description.
    """

    def __init__(self, entries: Sequence[tuple[str, str, int]], limits: bytes = b""):
        self._items = [
            bytes([code]) + f"{group}\0{name}\0".encode() for group, name, code in entries
        ]
        self._limits = limits
        self._index = {(group, name): i for i, (group, name, _) in enumerate(entries)}
        #: Changes with the table: clients keep tables by it.
        self.crc = zlib.crc32(b"".join(self._items))

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
            return request[:3] + self._items[index] if index < len(self._items) else request[:1]
        return None


def pid_paths(
    owner: str, pids: Mapping[str, str], attributes: Mapping[str, str]
) -> Iterable[tuple[str, str]]:
    """Yield (name, path from the `Firmware`) of attributes of PID controllers.

    ``owner`` is the path to the object that has the controllers. Prefixes of names lead to the
    owner's attributes (``pids``), suffixes to the controller's (``attributes``).
    """
    for prefix, pid in pids.items():
        for suffix, attribute in attributes.items():
            yield prefix + suffix, f"{owner}.{pid}.{attribute}"
