"""The file of a journal: a header and chunks of rows, which only grows.

A header is a line of JSON. A chunk is `CHUNK` and compressed rows; each begins with a number, one
more than the one before. A row is `ROW`: kind, number, value; rows of `WITH_DATA` are followed by
the length of their data (u16, or 0xFFFF and u32) and the data. Of a message, these are the
difference to the message before on the same subscription in the same chunk, if that is as long;
both are taken as numbers, the first byte the least. Stamps that are a period apart and values that
change little become bytes that repeat, which compress to half of those of the messages.

Rows of the present chunk are in a file beside it, ``PATH.tail``, mapped into memory: they survive
the end of the process at any moment, and cost no system call. At the end of the process they become
a chunk.
"""

import contextlib
import enum
import json
import mmap
import os
import struct
import threading
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

FORMAT = "crazyflie journal 1"  #: The first field of the header; another format has another number.
#: Fields of each header: absolute name of the process's node; "package.module:name" of what made
#: the nodes; "steady", "simulated" or "manual"; the machine's clock at the beginning, us; time of a
#: manual clock at the beginning, s.
_HEADER = {"node": str, "program": str, "clock": str, "us": int, "start": float}
SUFFIX = ".journal"  #: Of a journal's file.

_CHUNK = struct.Struct("<4sIIII")  # Mark, number, bytes compressed and not, CRC of the compressed.
_MARK = b"CFJc"
_ROW = struct.Struct("<BHI")
_ROW_SIZE, _pack_row = _ROW.size, _ROW.pack_into
_SHORT, _LONG = struct.Struct("<H"), struct.Struct("<HI")
_NUMBER = struct.Struct("<I")
_IS_LONG = 0xFFFF

_HALF = 1 << 18  #: Size of each half of the tail (bytes).
_FULL = 1 << 16  #: Size from which rows become a chunk (bytes).
_MAX_BACKLOG = 64  #: Number of chunks that may wait for a slow disk.
_LEVEL = 4  #: Level of compression: half as fast as 1, and a tenth smaller.
_LONGEST = 5.0  #: Time after which rows become a chunk (s): small chunks are compressed less.
MAX_DATA = 1 << 26  #: Longest data of a row that are read (bytes).


class Kind(enum.IntEnum):
    """What a row says; the meaning of its number, its value and its data.

    Inputs begin what the process does; all other rows were read, or published, while it did so. The
    value of an input is the time since the input before it (us).
    """

    # Inputs.
    MESSAGE = 1  #: A message. Subscription; `Origin` and the message.
    TIMERS = 2  #: Timers are due, or may be: the first one runs.
    TIMER = 3  #: The next one of the timers that were due runs.
    CALL = 4  #: A call of a service. Service; the request.
    REPLY = 5  #: The answer to the process's own request. Request; a byte, 0 or 1, answer or error.
    SUBMITTED = 6  #: A call by a thread. Input of a node, JSON: argument; or 0, JSON: what it was.
    PREPARE_SHUTDOWN = 7  #: The process is to end.
    SHUTDOWN = 8  #: The process ends.
    CLOCK = 9  #: A clock of a `FakeProcess` is set. 0: its own, 1: the machine's; f64: s.
    LAUNCH = 10  #: A node of an `OfflineProcess` is initialized. JSON: name, class.
    # What was read.
    TIME = 20  #: The clock was read before the process began. u64: ns.
    WALL = 21  #: Wall clock minus machine's clock has changed. i64: ns.
    COLLECTED = 22  #: A message that waited. Subscription; collections without one; as `MESSAGE`.
    FLAG = 23  #: Whether somebody listens, or publishes, has changed. Flag; times it was the same.
    VALUE = (
        24  #: A value. JSON: what; then true and the value, or false, type and text of an error.
    )
    NAME = 25  #: A remapped name. JSON: name, remapped.
    CALLER = 26  #: The name of a node that `Origin` may have.
    FILE = 27  #: A file was read (1), or not (0). JSON: path; a line feed; content, or JSON: error.
    # What there is.
    SUBSCRIBED = 30  #: A subscription. Subscription; JSON: topic and type.
    ADVERTISED = 31  #: A publisher. Publisher; JSON: topic and type.
    OFFERED = 32  #: A service. Service; JSON: name and type.
    # What was sent.
    PUBLISHED = 40  #: A message. Publisher; the last byte of the CRC of all messages until here.
    REQUESTED = 41  #: A call of a service. Request; CRC of its name and data.


#: Kinds that name things, and change nothing.
NAMES = frozenset((Kind.CALLER, Kind.SUBSCRIBED, Kind.ADVERTISED, Kind.OFFERED))
INPUTS = frozenset(kind for kind in Kind if kind < Kind.TIME)
_WITHOUT_DATA = {
    Kind.TIMERS, Kind.TIMER, Kind.PREPARE_SHUTDOWN, Kind.SHUTDOWN, Kind.FLAG, Kind.PUBLISHED,
    Kind.REQUESTED,
}  # fmt: skip
WITH_DATA = frozenset(set(Kind) - _WITHOUT_DATA)
_DIFFERENCES = frozenset({Kind.MESSAGE, Kind.COLLECTED})


class Row(NamedTuple):
    """A row of a journal."""

    kind: Kind
    number: int
    value: int
    data: bytes = b""


class JournalError(Exception):
    """A journal cannot be written or read; the text names the file and the reason."""


class SourcesError(JournalError):
    """The nodes of a journal read more than their handles gave, so that they cannot run again."""


class _Differences:
    """Subtracts the data of a subscription from those before; the same way back."""

    def __init__(self) -> None:
        self._last: dict[int, tuple[int, int]] = {}

    def encode(self, number: int, data: bytes) -> bytes:
        own = int.from_bytes(data, "little")
        size, last = self._last.get(number, (-1, 0))
        self._last[number] = len(data), own
        if size != len(data):
            return data
        return ((own - last) & ((1 << 8 * size) - 1)).to_bytes(size, "little")

    def decode(self, number: int, data: bytes) -> bytes:
        size, last = self._last.get(number, (-1, 0))
        own = int.from_bytes(data, "little")
        if size == len(data):
            own = (own + last) & ((1 << 8 * size) - 1)
            data = own.to_bytes(size, "little")
        self._last[number] = len(data), own
        return data


class JournalWriter:
    """Appends rows to a file, in one thread; compresses and writes them in another.

    ``keep`` is how many seconds of rows are kept beside those of the start, at least. ``report`` is
    called with the reason if the journal ends early, from any thread.
    """

    def __init__(
        self, path: Path, header: dict[str, Any], keep: float, report: Callable[[str], None]
    ):
        self.path, self.is_open = path, True
        self.header: dict[str, Any] = {"format": FORMAT, "start": 0.0, **header}
        self._report, self._keep = report, keep
        self._count, self._starts, self._has_failed = 0, True, False
        self._start_end = 0
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = open(path, "w+b", buffering=0)
            self._file.write(json.dumps(self.header).encode() + b"\n")
            self._header_end = self._file.tell()
            self._tail_path = path.with_name(path.name + ".tail")
            tail = os.open(self._tail_path, os.O_RDWR | os.O_CREAT | os.O_TRUNC)
            try:
                # Space is reserved: a full disk would otherwise end the process.
                os.posix_fallocate(tail, 0, 2 * _HALF)
                halves = [mmap.mmap(tail, _HALF, offset=offset) for offset in (0, _HALF)]
            finally:
                os.close(tail)
        except OSError as error:
            raise JournalError(f"journal {path} cannot be written: {error}") from None
        self._free: SimpleQueue[mmap.mmap] = SimpleQueue()
        for half in halves:
            self._free.put(half)
        self._chunks: SimpleQueue[tuple[int, bytes, mmap.mmap | None, float]] = SimpleQueue()
        self._kept: list[tuple[float, int]] = []  # Time and place of each chunk, s and bytes.
        self._rows: mmap.mmap  # The rows of the present chunk, behind its number.
        self._at: int  # Where the next row begins.
        self._chunk_begin: float  # When the chunk began (s).
        self._differences: _Differences
        self._begin()
        self._thread = threading.Thread(target=self._write_chunks, name="journal", daemon=True)
        self._thread.start()

    def row(self, kind: int, number: int, value: int, data: bytes | None = None) -> None:
        """Append a row, with the data of the kinds that have some."""
        at = self._at
        if data is None:
            self._at = end = at + _ROW_SIZE
            if end > _HALF:
                return self._retry(at, kind, number, value, data)
            _pack_row(self._rows, at, kind, number, value)
            return None
        size = len(data)
        start = at + _ROW_SIZE + (_SHORT.size if size < _IS_LONG else _LONG.size)
        self._at = end = start + size
        if end > _HALF:
            return self._retry(at, kind, number, value, data)
        if kind in _DIFFERENCES:
            data = self._differences.encode(number, data)
        # The kind is written last: a row counts once it is complete.
        rows = self._rows
        rows[start:end] = data
        if size < _IS_LONG:
            _SHORT.pack_into(rows, at + _ROW_SIZE, size)
        else:
            _LONG.pack_into(rows, at + _ROW_SIZE, _IS_LONG, size)
        _pack_row(rows, at, kind, number, value)
        return None

    def pause(self, time: float) -> None:
        """Make a chunk of the rows if they are many or old; ``time`` is now (s)."""
        if self._at > _FULL or time - self._chunk_begin > _LONGEST:
            self._finish(time)
            self._chunk_begin = time

    def end_start(self) -> None:
        """Keep what was written until now, whatever is dropped later."""
        self._finish(0.0)
        self._starts = False

    def close(self) -> None:
        """Write what is left, and end the file."""
        if self.is_open:
            self._finish(self._chunk_begin)
            self.is_open = False
            self._chunks.put((0, b"", None, 0.0))
            self._thread.join(2.0)
            if not self._thread.is_alive():
                self._tail_path.unlink(missing_ok=True)

    def _begin(self):
        self._count += 1
        if self._free.empty():
            # The disk is slow: these rows would not survive the end of the process.
            self._rows = mmap.mmap(-1, _HALF)
        else:
            self._rows = self._free.get()
        _NUMBER.pack_into(self._rows, 0, self._count)
        self._at = _NUMBER.size
        self._chunk_begin = 0.0
        self._differences = _Differences()

    def _finish(self, time):
        if self._at > _NUMBER.size and self.is_open:
            data = self._rows[_NUMBER.size : self._at]
            self._chunks.put((self._count, data, self._rows, -1.0 if self._starts else time))
            if self._chunks.qsize() > _MAX_BACKLOG:
                self.end(f"the disk is too slow: {_MAX_BACKLOG} chunks wait for it")
            self._begin()

    def _retry(self, at, kind, number, value, data):
        """Append a row that does not fit into the rest of the half; a longer one is a chunk."""
        self._at = at
        if not self.is_open:
            # The rows of a journal that has ended are lost.
            self._at = _NUMBER.size
            return
        self._finish(self._chunk_begin)
        size = len(data or b"")
        if size + _NUMBER.size + _ROW.size + _LONG.size <= _HALF:
            self.row(kind, number, value, data)
            return
        head = _ROW.pack(kind, number, value) + _LONG.pack(_IS_LONG, size)
        self._chunks.put((self._count, head + data, None, self._chunk_begin))
        self._count += 1
        _NUMBER.pack_into(self._rows, 0, self._count)

    def end(self, reason: str) -> None:
        """End the journal early, with a report; from any thread."""
        self.is_open = False
        self._report(f"journal {self.path} has ended: {reason}; the nodes run on")

    # In the thread.

    def _write_chunks(self):
        while True:
            number, data, rows, time = self._chunks.get()
            if not number:
                self._file.close()
                return
            try:
                if not self._has_failed:
                    self._write(number, data, time)
            except OSError as error:
                self._has_failed = True
                self.end(str(error.strerror))
            if rows is not None:
                rows[: len(data) + _NUMBER.size] = bytes(len(data) + _NUMBER.size)
                self._free.put(rows)

    def _write(self, number, data, time):
        packed = zlib.compress(data, _LEVEL)
        head = _CHUNK.pack(_MARK, number, len(packed), len(data), zlib.crc32(packed))
        if time < 0.0:
            self._start_end = self._file.tell() + len(head) + len(packed)
        else:
            self._kept.append((time, self._file.tell()))
        self._file.write(head + packed)
        if self._kept and self._kept[-1][0] - self._kept[0][0] > 1.5 * self._keep + 2.0 * _LONGEST:
            self._drop()

    def _drop(self):
        """Write the file anew without the oldest chunks, those of the start excepted."""
        newest = self._kept[-1][0]
        first = next(place for time, place in self._kept if time >= newest - self._keep)
        new = self.path.with_name(self.path.name + ".new")
        with open(new, "w+b", buffering=0) as file:
            self._file.seek(0)
            file.write(self._file.read(self._start_end))
            self._file.seek(first)
            while block := self._file.read(1 << 20):
                file.write(block)
        new.replace(self.path)
        self._file.close()
        self._file = open(self.path, "r+b", buffering=0)
        self._file.seek(0, os.SEEK_END)
        shift = first - self._start_end
        self._kept = [(time, place - shift) for time, place in self._kept if place >= first]


class Journal:
    """A journal that is read: its header, and its rows up to where it is damaged.

    `JournalError` if it is none.
    """

    def __init__(self, path: Path):
        self.path = path
        #: Why the rows end early, once they have been read; or that some are gone.
        self.damage = ""
        self.position = 0  #: How far the file has been read (bytes).
        try:
            with open(path, "rb") as file:
                line = file.readline(1 << 20)
                self._begin = file.tell()
        except OSError as error:
            raise JournalError(f"journal {path} cannot be read: {error.strerror}") from None
        try:
            self.header = json.loads(line)
            found = self.header["format"]
        except (ValueError, KeyError, TypeError):
            raise JournalError(
                f"{path} is not a journal; expected a first line of JSON with the format {FORMAT!r}"
            ) from None
        if found != FORMAT:
            raise JournalError(f"{path} has the format {found!r}; expected {FORMAT!r}")
        for name, kind in _HEADER.items():
            if not isinstance(self.header.get(name), kind):
                raise JournalError(
                    f"{path}: {name} is {self.header.get(name)!r}; expected {kind.__name__}"
                )

    def rows(self) -> Iterator[Row]:
        """Yield all rows in order; `damage` says whether there may have been more."""
        expected = 1
        for number, data in self._chunks():
            if number != expected:
                # What is left cannot follow from what was before.
                self.damage = (
                    f"chunks {expected} to {number - 1} are not in it: older ones were dropped "
                    "(it keeps CRAZYFLIE_JOURNAL_MINUTES), or the file was changed; in which state "
                    "the nodes were after them is not known"
                )
                return
            expected = number + 1
            yield from self._rows(data)
            if self.damage:
                return

    def _chunks(self):
        last = 0
        # Before the file: what a process that runs moves into it meanwhile is seen in one of them.
        tail = b""
        with contextlib.suppress(OSError):
            tail = self.path.with_name(self.path.name + ".tail").read_bytes()
        with open(self.path, "rb") as file:
            file.seek(self._begin)
            while head := file.read(_CHUNK.size):
                if len(head) < _CHUNK.size or head[:4] != _MARK:
                    self.damage = f"it is damaged or cut at byte {file.tell() - len(head)}"
                    break
                _, number, size, length, crc = _CHUNK.unpack(head)
                packed = file.read(min(size, MAX_DATA))
                try:
                    if len(packed) < size or zlib.crc32(packed) != crc:
                        raise zlib.error
                    data = zlib.decompressobj().decompress(packed, min(length, MAX_DATA))
                    if len(data) != length:
                        raise zlib.error
                except zlib.error:
                    self.damage = f"chunk {number} is damaged or cut"
                    break
                last, self.position = number, file.tell()
                yield number, data
        # Of a process that has not ended by itself.
        halves = (tail[:_HALF], tail[_HALF : 2 * _HALF])
        found = (
            (_NUMBER.unpack_from(half)[0], half) for half in halves if len(half) >= _NUMBER.size
        )
        for number, half in sorted(found):
            if number > last:
                yield number, half[_NUMBER.size :]

    def _rows(self, data):
        differences, at, end = _Differences(), 0, len(data)
        while at < end and data[at]:
            try:
                kind, number, value = _ROW.unpack_from(data, at)
                kind = Kind(kind)
                at += _ROW.size
                if kind not in WITH_DATA:
                    yield Row(kind, number, value)
                    continue
                (size,) = _SHORT.unpack_from(data, at)
                at += _SHORT.size
                if size == _IS_LONG:
                    (size,) = _NUMBER.unpack_from(data, at)
                    at += _NUMBER.size
                if at + size > end:
                    raise struct.error
            except (struct.error, ValueError):
                self.damage = "a row is damaged"
                return
            own = data[at : at + size]
            at += size
            yield Row(
                kind,
                number,
                value,
                differences.decode(number, own) if kind in _DIFFERENCES else own,
            )
