"""The program journal: what a journal has, or the messages of one of its topics."""

import argparse
import itertools
import json
import os
import struct
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import genpy
import roslib.message

from crazyflie_utils.journal.journal_file import Journal, JournalError, Kind, Row, received
from crazyflie_utils.journal.replay_transport import Rows

_GAP = 0.5  #: Time without an input that is listed (s): longer than most periods.
_MAX_LINES = 20  #: Lines of calls, and of gaps.
_LONG = 10  #: A gap of so many periods is told, of a topic with more messages than that.


class Contents:
    """What a journal has; times are s since the start, as `replay` prints them."""

    def __init__(self, path: Path):
        self.journal = Journal(path)
        self.names = Rows(self.journal)
        self.time = 0.0
        self.parameters: dict[str, Any] = {}
        self.calls: list[str] = []
        self.gaps: list[str] = []
        self.counts: Counter[tuple[Kind, int]] = Counter()
        #: Subscription -> sender -> times of its messages (s).
        self.callers: defaultdict[int, defaultdict[str, list[float]]] = defaultdict(
            lambda: defaultdict(list)
        )
        self.threads: Counter[str] = Counter()  #: Functions that threads have called.

    def rows(self) -> Iterator[Row]:
        """Yield the rows, and count them; `JournalError` or ValueError for one that is none."""
        while self.names.next is not None:
            row, before = self.names.take(), self.time
            self.time = self.names.time
            if self.time - before > _GAP:
                self.gaps.append(f"{before:.3f} s to {self.time:.3f} s")
            self._count(row)
            yield row

    def _count(self, row):
        if row.kind is Kind.MESSAGE:
            self.counts[Kind.SUBSCRIBED, row.number] += 1
            self.callers[row.number][self.sender(row)].append(self.time)
        elif row.kind is Kind.PUBLISHED:
            self.counts[Kind.ADVERTISED, row.number] += 1
        elif row.kind is Kind.CALL:
            self.counts[Kind.OFFERED, row.number] += 1
            name, kind = self.name(Kind.OFFERED, row.number)
            service_type = roslib.message.get_service_class(kind)
            text = f"{len(row.data)} bytes of an unknown type"
            if service_type is not None:
                text = _line(service_type._request_class().deserialize(row.data))
            self.calls.append(f"{self.time:.6f} s {name} {text}".rstrip())
        elif row.kind is Kind.SUBMITTED and row.number == 0:
            self.threads[json.loads(row.data)[1]] += 1
        elif row.kind is Kind.VALUE:
            what, is_value, *rest = json.loads(row.data)
            # The first value is that of the start.
            if is_value and what.startswith("/"):
                self.parameters.setdefault(what, rest[0])

    def sender(self, row: Row) -> str:
        """Return the node that has sent a message."""
        header = self.names.connection(received(row)[0]) or {}
        return header.get("callerid") or "?"

    def name(self, kind: Kind, number: int) -> list[str]:
        """Return name and type of a topic or service."""
        return self.names.names[kind].get(number, ["(a thread has registered it)", "?"])

    def began(self) -> str:
        """Return the wall time at the start, if it is known."""
        began = self.journal.header.get("began")
        if not isinstance(began, str):
            return "when is not known"
        return f"began {began.replace('T', ' ')}"

    def text(self) -> str:
        """Return all of it for people, once `rows` has been read."""
        header, journal = self.journal.header, self.journal
        what = header["program"] or "nodes without a program"
        lines = [f"{header['node']} ({what}), clock {header['clock']}, {self.began()}"]
        lines.append(f"{self.time:.1f} s, {self.names.inputs:,} inputs; {self._end()}")
        lines += _section(
            "parameters at the start",
            [f"{name}: {json.dumps(value)}" for name, value in self.parameters.items()],
        )
        for title, kind in (
            ("subscriptions", Kind.SUBSCRIBED),
            ("publishers", Kind.ADVERTISED),
            ("services", Kind.OFFERED),
        ):
            numbers = sorted(
                self.names.names[kind].keys() | {n for k, n in self.counts if k is kind}
            )
            lines += _section(title, [self._registered(kind, number) for number in numbers])
        lines += _section("calls", self.calls, _MAX_LINES)
        threads = [f"{name}: {count:,}" for name, count in self.threads.most_common()]
        lines += _section("called by threads, which cannot be run again", threads, _MAX_LINES)
        lines += _section(f"more than {_GAP:g} s without an input", self.gaps, _MAX_LINES)
        if journal.damage:
            lines.append(journal.damage)
        return "\n".join(lines)

    def _registered(self, kind, number):
        name, type_name = self.name(kind, number)
        count = self.counts[kind, number]
        rate = f", {count / self.time:.1f} Hz" if self.time and kind is not Kind.OFFERED else ""
        callers = self.callers[number] if kind is Kind.SUBSCRIBED else {}
        texts = [f"{sender} ({_span(times)})" for sender, times in sorted(callers.items())]
        senders = f", from {', '.join(texts)}" if texts else ""
        return f"{name} ({type_name}): {count:,}{rate}{senders}"

    def _end(self):
        if self.journal.header["clock"] == "manual":
            return "with a clock set by hand"
        return "ended by itself" if self.names.counts[Kind.SHUTDOWN] else "did not end by itself"


def _span(times):
    """Return number, first and last time of messages, and their longest gap if it is long."""
    gap, end = max((b - a, b) for a, b in itertools.pairwise([times[0], *times]))
    mean = (times[-1] - times[0]) / len(times)
    is_long = gap > max(_GAP, _LONG * mean) and len(times) > _LONG
    text = f"{len(times):,}, {times[0]:.2f} to {times[-1]:.2f} s"
    return text + (f", none for {gap:.2f} s before {end:.2f} s" if is_long else "")


def _section(title, lines, most=sys.maxsize):
    if not lines:
        return []
    more = [f"  and {len(lines) - most:,} more"] if len(lines) > most else []
    return [f"{title}:", *(f"  {line}" for line in lines[:most]), *more]


def _line(message: genpy.Message) -> str:
    return " ".join(str(message).split())


def print_messages(contents: Contents, topic: str) -> int:
    """Print the messages that were received on a topic; return how many."""
    count = 0
    for row in contents.rows():
        if row.kind is not Kind.MESSAGE:
            continue
        name, kind = contents.name(Kind.SUBSCRIBED, row.number)
        message_type = roslib.message.get_message_class(kind) if name == topic else None
        if message_type is not None:
            count += 1
            text = _line(message_type().deserialize(received(row)[2]))
            print(f"{contents.time:.6f} s {contents.sender(row)}: {text}")
    return count


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; return its exit status."""
    parser = argparse.ArgumentParser(
        prog="journal",
        description="Print what a journal has: parameters, topics, services, calls, gaps. "
        "Exit status: 0; 2 if it cannot be read, or lacks the topic.",
    )
    parser.add_argument("journal", type=Path, metavar="JOURNAL")
    parser.add_argument("--topic", metavar="NAME", help="print the messages received on this topic")
    options: Any = parser.parse_args(arguments)
    try:
        contents = Contents(options.journal)
        if options.topic is None:
            for _ in contents.rows():
                pass
            print(contents.text())
        elif not print_messages(contents, options.topic):
            known = sorted(name for name, _ in contents.names.names[Kind.SUBSCRIBED].values())
            parser.error(
                f"{options.journal} has no message on {options.topic}; its subscriptions: "
                + (", ".join(known) or "none")
            )
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader has closed the pipe, and Python would still flush into it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (ValueError, LookupError, TypeError, struct.error, genpy.DeserializationError) as error:
        parser.error(f"{options.journal}: a row cannot be read: {error}")
    except JournalError as error:
        parser.error(str(error))
    return 0
