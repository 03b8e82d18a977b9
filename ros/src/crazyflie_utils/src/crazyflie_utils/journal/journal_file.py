"""The file of a journal: a header and chunks of rows, which only grows.

A header is a line of JSON. A chunk is `CHUNK` and compressed columns; each begins with a number,
one more than the one before. A row is a `HEAD`: size of its data, value, number, kind; and its
data. A chunk has the number of its rows (u32), the bytes of all heads, first byte of each row, then
the second and so on; then those of the messages of each subscription and size, in the order of
these, as differences to the same byte of the message before; then all other data, the last row's
first. So stamps that are a period apart and values that change little become bytes that repeat.

Rows of the present chunk are in a file beside it, ``PATH.tail``, mapped into memory: they survive
the end of the process at any moment, and cost no system call. Its two halves begin with the number
of a chunk; heads follow, and the data of the first one are at the end, those of the next before
them. At the end of the process they become a chunk.
"""

import contextlib
import enum
import itertools
import json
import mmap
import os
import struct
import threading
import zlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

FORMAT = "crazyflie journal 3"  #: The first field of the header; another format has another number.
#: Fields of each header: absolute name of the process's node; "package.module:name" of what made
#: the nodes; "steady", "simulated" or "manual"; the machine's clock at the beginning, us; time of a
#: manual clock at the beginning, s.
_HEADER = {"node": str, "program": str, "clock": str, "us": int, "start": float}
_CLOCKS = ("steady", "simulated", "manual")
SUFFIX = ".journal"  #: Of a journal's file.

CHUNK = struct.Struct("<4sIIII")  #: Mark, number, bytes compressed and not, CRC of the compressed.
_MARK = b"CFJc"
HEAD = struct.Struct("<IIHB")
_HEADS = np.dtype([("size", "<u4"), ("value", "<u4"), ("number", "<u2"), ("kind", "u1")])
_HEAD_SIZE, _pack_head = HEAD.size, HEAD.pack_into
_NUMBER = struct.Struct("<I")
ORIGIN = struct.Struct("<H")  #: Before a message: `PLAIN`, and the number of its connection, or 0.
PLAIN = 0x8000  #: It came decoded.

_HALF = 1 << 18  #: Size of each half of the tail (bytes).
_FULL = 3 << 16  #: Size from which rows become a chunk (bytes).
_MAX_BACKLOG = 64  #: Number of chunks that may wait for a slow disk.
_LEVEL = 1  #: Level of compression: 4 takes a third longer, for 7 % less.
_LONGEST = 5.0  #: Time after which rows become a chunk (s): small chunks are compressed less.
MAX_DATA = 1 << 26  #: Longest data of a row that are read (bytes).


class Kind(enum.IntEnum):
    """What a row says; the meaning of its number, its value and its data.

    Inputs begin what the process does; all other rows were read, or published, while it did so. The
    value of an input is the time since the input before it (us).
    """

    # Inputs.
    MESSAGE = 1  #: A message. Subscription; `ORIGIN` and the message.
    TIMERS = 2  #: Timers are due, or may be: the first one runs.
    TIMER = 3  #: The next one of the timers that were due runs.
    CALL = 4  #: A call of a service. Service; the request.
    REPLY = 5  #: The answer to the process's own request. Request; a byte, 0 or 1, answer or error.
    SUBMITTED = 6  #: A call by a thread. Input of a node, JSON: argument; or 0, JSON: what it was.
    PREPARE_SHUTDOWN = 7  #: The process is to end.
    SHUTDOWN = 8  #: The process ends.
    CLOCK = 9  #: A clock of a `FakeProcess` is set. 0: its own, 1: the machine's; f64: s.
    LAUNCH = 10  #: A node of an `OfflineProcess` is initialized. JSON: name, class.
    TASK = 11  #: A task of `Tasks` begins or goes on. Task.
    # What was read.
    TIME = 20  #: The clock was read before the process began. u64: ns.
    #: Wall clock minus machine's clock has changed. 1: as a callback reads it; i64: ns.
    WALL = 21
    #: A value. JSON: what; then true and the value, or false, type and text of an error.
    VALUE = 24
    NAME = 25  #: A remapped name. JSON: name, remapped.
    CALLER = 26  #: A connection that `ORIGIN` may have: node, topic.
    PEERS = 28  #: Whether somebody listens, or publishes, has changed. Flag; 0 or 1.
    FILE = 27  #: A file was read (1), or not (0). JSON: path; a line feed; content, or JSON: error.
    # What there is.
    SUBSCRIBED = 30  #: A subscription. Subscription; JSON: topic and type.
    ADVERTISED = 31  #: A publisher. Publisher; JSON: topic and type.
    OFFERED = 32  #: A service. Service; JSON: name and type.
    # What was sent.
    PUBLISHED = 40  #: A message. Publisher; what `CHECKED` has of it, where it is known.
    REQUESTED = 41  #: A call of a service. Request; CRC of its name and data.
    CHECKED = 42  #: Messages since the row before: of each, the last byte of the CRC of all so far.


#: Kinds that name things, and change nothing.
NAMES = frozenset((Kind.CALLER, Kind.SUBSCRIBED, Kind.ADVERTISED, Kind.OFFERED))
#: Size of the data of kinds that are a number (bytes).
_SIZES = {int(kind): 8 for kind in (Kind.TIME, Kind.WALL, Kind.CLOCK)}
INPUTS = frozenset(kind for kind in Kind if kind < Kind.TIME)


UNCHECKED = -1  #: Value of a message that was published before its process died without the check.


class Row(NamedTuple):
    """A row of a journal."""

    kind: Kind
    number: int
    value: int
    data: bytes = b""


def received(row: Row) -> tuple[int, bool, bytes]:
    """Return of a message the number of its connection, whether it came decoded, its bytes."""
    (origin,) = ORIGIN.unpack_from(row.data)
    return origin & ~PLAIN, bool(origin & PLAIN), row.data[ORIGIN.size :]


class JournalError(Exception):
    """A journal cannot be written or read; the text names the file and the reason."""


class SourcesError(JournalError):
    """The nodes of a journal read more than their handles gave, so that they cannot run again."""


def _to_columns(heads: bytes, data: bytes) -> bytes:
    """Return the content of a chunk; ``data`` are those of the rows, the last one's first."""
    count = len(heads) // _HEAD_SIZE
    parts = [_NUMBER.pack(count), _turned(np.frombuffer(heads, np.uint8).reshape(-1, _HEAD_SIZE))]
    messages, others = _places(np.frombuffer(heads, _HEADS), len(data))
    source = np.frombuffer(data, np.uint8)
    for size, begins in messages:
        values = sliding_window_view(source, size)[begins]
        parts.append(_turned(np.diff(values, axis=0, prepend=values[:1] * 0)))
    return b"".join([*parts, *(data[place] for place in others)])


def _from_columns(content: bytes) -> tuple[NDArray[Any], bytes]:
    """Return the heads of a chunk and the data of its rows, the last one's first; or ValueError."""
    (count,) = _NUMBER.unpack_from(content)
    at = _NUMBER.size + count * _HEAD_SIZE
    columns = np.frombuffer(content[_NUMBER.size : at], np.uint8).reshape(_HEAD_SIZE, count)
    heads = np.frombuffer(_turned(columns), _HEADS)
    left = np.frombuffer(content, np.uint8, offset=at)
    data = np.empty_like(left)
    messages, others = _places(heads, len(data))
    for size, begins in messages:
        differences, left = np.split(left, [size * len(begins)])
        values = np.cumsum(differences.reshape(size, -1), axis=1, dtype=np.uint8)
        sliding_window_view(data, size, writeable=True)[begins] = values.T
    for place in others:
        data[place], left = np.split(left, [place.stop - place.start])
    return heads, data.tobytes()


def _turned(array: NDArray[Any]) -> bytes:
    """Return the bytes of an array, column by column."""
    # In a sixth of the time of ``tobytes("F")``.
    return np.ascontiguousarray(array.T).tobytes()


def _places(heads: NDArray[Any], total: int) -> tuple[list[tuple[int, NDArray[Any]]], list[slice]]:
    """Return size and places of the messages of each subscription, and the places of other data."""
    heads = heads[heads["size"] > 0]
    sizes = heads["size"].astype(np.int64)
    begins = total - np.cumsum(sizes)
    if (begins[-1] if len(begins) else total) != 0:
        raise ValueError("sizes do not add up")
    is_message = heads["kind"] == int(Kind.MESSAGE)
    keys = np.where(is_message, heads["number"].astype(np.int64) << 32 | sizes, 0)
    messages = [(int(sizes[keys == key][0]), begins[keys == key]) for key in np.unique(keys) if key]
    others = zip(begins[~is_message].tolist(), sizes[~is_message].tolist(), strict=True)
    return messages, [slice(begin, begin + size) for begin, size in others]


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
        self.before_chunk: Callable[[], None] = lambda: None  #: Appends the last rows of a chunk.
        self._count, self._starts, self._has_failed = 0, True, False
        self._start_end = 0
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = open(path, "w+b", buffering=0)
            self._file.write(json.dumps(self.header).encode() + b"\n")
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
        self._chunks: SimpleQueue[tuple[int, bytes, bytes, mmap.mmap | None, float]] = SimpleQueue()
        self._kept: list[tuple[float, int]] = []  # Time and place of each chunk, s and bytes.
        self._rows: mmap.mmap  # The rows of the present chunk, behind its number.
        self._at: int  # Where the next head begins.
        self._top: int  # Where the data of the last row begin.
        self._chunk_begin: float  # When the chunk began (s).
        self._begin()
        self._thread = threading.Thread(target=self._write_chunks, name="journal", daemon=True)
        self._thread.start()

    def row(self, kind: int, number: int, value: int, data: bytes = b"") -> None:
        """Append a row."""
        at, top, size = self._at, self._top, len(data)
        if at + _HEAD_SIZE + size > top:
            return self._retry(kind, number, value, data)
        if size:
            self._top = top - size
            self._rows[top - size : top] = data
        # The kind is written last: a row counts once it is complete.
        _pack_head(self._rows, at, size, value, number, kind)
        self._at = at + _HEAD_SIZE
        return None

    def pause(self, time: float) -> None:
        """Make a chunk of the rows if they are many or old; ``time`` is now (s)."""
        if self._at + _HALF - self._top > _FULL or time - self._chunk_begin > _LONGEST:
            self.before_chunk()
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
            self._chunks.put((0, b"", b"", None, 0.0))
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
        self._at, self._top = _NUMBER.size, _HALF
        self._chunk_begin = 0.0

    def _finish(self, time):
        if self._at > _NUMBER.size and self.is_open:
            rows = self._rows
            heads, data = rows[_NUMBER.size : self._at], rows[self._top : _HALF]
            time = -1.0 if self._starts else time
            self._chunks.put((self._count, heads, data, rows, time))
            if self._chunks.qsize() > _MAX_BACKLOG:
                self.end(f"the disk is too slow: {_MAX_BACKLOG} chunks wait for it")
            self._begin()

    def _retry(self, kind, number, value, data):
        """Append a row that does not fit into the rest of the half; a longer one is a chunk."""
        if not self.is_open:
            # The rows of a journal that has ended are lost.
            self._at, self._top = _NUMBER.size, _HALF
            return
        self._finish(self._chunk_begin)
        if _NUMBER.size + _HEAD_SIZE + len(data) <= _HALF:
            self.row(kind, number, value, data)
            return
        head = HEAD.pack(len(data), value, number, kind)
        self._chunks.put((self._count, head, data, None, self._chunk_begin))
        self._count += 1
        _NUMBER.pack_into(self._rows, 0, self._count)

    def end(self, reason: str) -> None:
        """End the journal early, with a report; from any thread."""
        self.is_open = False
        self._report(f"journal {self.path} has ended: {reason}; the nodes run on")

    # In the thread.

    def _write_chunks(self):
        while True:
            number, heads, data, rows, time = self._chunks.get()
            if not number:
                self._file.close()
                return
            try:
                if not self._has_failed:
                    self._write(number, _to_columns(heads, data), time)
            except OSError as error:
                self._has_failed = True
                self.end(str(error.strerror))
            if rows is not None:
                rows[: len(heads) + _NUMBER.size] = bytes(len(heads) + _NUMBER.size)
                rows[_HALF - len(data) :] = bytes(len(data))
                self._free.put(rows)

    def _write(self, number, data, time):
        packed = zlib.compress(data, _LEVEL)
        head = CHUNK.pack(_MARK, number, len(packed), len(data), zlib.crc32(packed))
        if time < 0.0:
            self._start_end = self._file.tell() + len(head) + len(packed)
        else:
            self._kept.append((time, self._file.tell()))
        self._file.write(head + packed)
        if self._kept and self._kept[-1][0] - self._kept[0][0] > 1.5 * self._keep + 2.0 * _LONGEST:
            self._drop()

    def _drop(self):
        """Write the file again without the oldest chunks, those of the start excepted."""
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
                    f"{path}: {name} is {self.header.get(name)!r:.80}; expected {kind.__name__}"
                )
        if self.header["clock"] not in _CLOCKS:
            raise JournalError(
                f"{path}: clock is {self.header['clock']!r:.80}; expected {_CLOCKS[0]}, "
                f"{_CLOCKS[1]} or {_CLOCKS[2]}"
            )

    def rows(self) -> Iterator[Row]:
        """Yield all rows in order; `damage` says whether there may have been more."""
        return _with_checks(self._all_rows())

    def _all_rows(self):
        expected = 1
        for number, content, is_tail in self._chunks():
            if number != expected:
                # What is left cannot follow from what was before.
                self.damage = (
                    f"chunk {expected} is not in its place, but {number} is: older ones were "
                    "dropped (it keeps CRAZYFLIE_JOURNAL_MINUTES), or the file was changed; in "
                    "which state the nodes were then is not known"
                )
                return
            expected = number + 1
            try:
                yield from (_tail_rows if is_tail else _rows)(content)
            except (struct.error, ValueError):
                self.damage = "a row is damaged"
                return

    def _chunks(self):
        last = 0
        # Before the file: what a process that runs moves into it meanwhile is seen in one of them.
        tail = b""
        with contextlib.suppress(OSError):
            tail = self.path.with_name(self.path.name + ".tail").read_bytes()
        with open(self.path, "rb") as file:
            file.seek(self._begin)
            while head := file.read(CHUNK.size):
                if len(head) < CHUNK.size or head[:4] != _MARK:
                    self.damage = f"it is damaged or cut at byte {file.tell() - len(head)}"
                    break
                _, number, size, length, crc = CHUNK.unpack(head)
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
                yield number, data, False
        # Of a process that has not ended by itself.
        halves = (tail[:_HALF], tail[_HALF : 2 * _HALF])
        found = (
            (_NUMBER.unpack_from(half)[0], half) for half in halves if len(half) >= _NUMBER.size
        )
        for number, half in sorted(found):
            if number > last:
                yield number, half[_NUMBER.size :], True


def _rows(content: bytes) -> Iterator[Row]:
    """Yield the rows of a chunk."""
    return _made(*_from_columns(content))


def _tail_rows(content: bytes) -> Iterator[Row]:
    """Yield the rows of half a tail, without its number."""
    heads = np.frombuffer(content[: len(content) // _HEAD_SIZE * _HEAD_SIZE], _HEADS)
    return _made(heads[: np.argmin(heads["kind"] != 0)], content)


def _made(heads: NDArray[Any], data: bytes) -> Iterator[Row]:
    begin = len(data)
    for size, value, number, kind in heads.tolist():
        begin, end = begin - size, begin
        if begin < 0 or size != _SIZES.get(kind, size):
            raise ValueError("the data of a row are missing")
        yield Row(Kind(kind), number, value, data[begin:end])


def _with_checks(rows: Iterable[Row]) -> Iterator[Row]:
    """Yield rows, with the checks of messages as their values."""
    waiting: list[Row] = []
    for row in itertools.chain(rows, [Row(Kind.CHECKED, 0, 0)]):
        if row.kind is not Kind.CHECKED:
            waiting.append(row)
            continue
        checks = iter(row.data)
        for each in waiting:
            if each.kind is Kind.PUBLISHED:
                yield Row(Kind.PUBLISHED, each.number, next(checks, UNCHECKED), each.data)
            else:
                yield each
        waiting.clear()
