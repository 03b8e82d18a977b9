"""The messages of a process in the journals of those that received them."""

import struct
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import genpy

from crazyflie_utils.journal.journal_file import Journal, JournalError, Kind, received
from crazyflie_utils.journal.recording import serialized
from crazyflie_utils.journal.replay_transport import Rows


class Received(NamedTuple):
    """A message that a process has received; the time is that of the machine's wall clock, ns."""

    receiver: str
    moment: int
    data: bytes


def received_value(
    journals: Iterable[Path],
    node: str,
    topic: str,
    published: Sequence[genpy.Message],
    moment: int,
) -> tuple[str, Any] | None:
    """Return who received what a node published then in place of a message, and that message.

    ``published`` are the last messages on the topic, of which the last one is others than then;
    ``moment`` is when that was published (wall clock, ns). None if no journal has it.
    """
    *before, message = published
    known = [_content(each, serialized(each)) for each in before]
    best: tuple[int, int, Received] | None = None
    for path in journals:
        arrived = list(_messages(path, node, topic, message._type))
        contents = [_content(message, each.data) for each in arrived]
        for k, each in enumerate(arrived):
            matching = 0
            while (
                matching < min(k, len(known)) and contents[k - 1 - matching] == known[-1 - matching]
            ):
                matching += 1
            # The same values may be published for minutes. Whether a publisher's first message
            # arrived is not known.
            rank = matching, -abs(each.moment - moment)
            if (matching or not known) and (best is None or rank > best[:2]):
                best = *rank, each
    if best is None:
        return None
    try:
        return best[2].receiver, type(message)().deserialize(best[2].data)
    except genpy.DeserializationError:
        return None


def _content(message, data):
    # Without the sequence number, which rospy sets.
    return data[4:] if message._has_header else data


def _messages(path: Path, node: str, topic: str, type_name: str) -> Iterator[Received]:
    """Yield the messages of a node on a topic, as one subscription has received them."""
    try:
        journal = Journal(path)
        rows, first = Rows(journal), None
        while rows.next is not None:
            row = rows.take()
            if row.kind is not Kind.MESSAGE:
                continue
            if rows.names[Kind.SUBSCRIBED].get(row.number) != [topic, type_name]:
                continue
            number, _, data = received(row)
            connection = rows.connection(number) or {}
            if connection.get("callerid") == node and first in (None, row.number):
                first = row.number
                yield Received(journal.header["node"], rows.us * 1000 + rows.wall_offset, data)
    except (JournalError, struct.error, ValueError, TypeError):
        # What can be read of it is enough.
        return


def first_difference(now: Any, then: Any, name: str = "") -> tuple[str, Any, Any] | None:
    """Return the first field in which two messages differ, and both values; None if in none.

    The sequence number of the header, which rospy sets, is not compared.
    """
    if isinstance(now, genpy.Message):
        for field in now.__slots__:
            if field != "raw" and (name, field) != ("header", "seq"):
                path = f"{name}.{field}" if name else field
                found = first_difference(getattr(now, field), getattr(then, field), path)
                if found is not None:
                    return found
        return None
    if isinstance(now, (list, tuple)) and isinstance(then, (list, tuple)):
        if len(now) != len(then):
            return f"number of {name}", len(now), len(then)
        for k, pair in enumerate(zip(now, then, strict=True)):
            found = first_difference(*pair, f"{name}[{k}]")
            if found is not None:
                return found
        return None
    # Of numbers, the bits count: not a number is itself, and -0 is not 0.
    return None if repr(now) == repr(then) else (name, now, then)
