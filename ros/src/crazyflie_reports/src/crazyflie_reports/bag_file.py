"""Messages of a bag file in the order in which they were recorded.

The file is read from its beginning to its end, without its index: a bag without an index, or a
truncated one, is read as far as possible, and memory holds one chunk (768 kB by default) at a time.
Format: https://wiki.ros.org/Bags/Format/2.0.
"""

import bz2
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import lz4.frame
import roslib.message
from typing_extensions import override

MAGIC = b"#ROSBAG V2.0\n"

_MESSAGE, _BAG_HEADER, _CHUNK, _CONNECTION = b"\x02", b"\x03", b"\x05", b"\x07"

#: Largest size of a decompressed chunk (bytes); rosbag's have 768 kB. Largest size of all
#: decompressed chunks: this many bytes plus this many times the size of the file. Flights are
#: compressed to a third.
LARGEST_CHUNK = 1 << 28
LEAST_TOTAL, LARGEST_RATIO = 1 << 30, 100

_PIECE = 1 << 20  # Size of decompressed data (bytes).

DECOMPRESSORS = {b"bz2": bz2.BZ2Decompressor, b"lz4": lz4.frame.LZ4FrameDecompressor}

_UINT32 = struct.Struct("<I")
_UINT64 = struct.Struct("<Q")
_TIME = struct.Struct("<II")


class BagError(Exception):
    """The file cannot be read at all; the text names it and says why."""


class ExpansionError(Exception):
    """Decompressed data are too large; the text says how large."""


class Expansion:
    """Decompresses a file's chunks within a limit of their size.

    A malicious file of some kilobytes may expand to more than memory or disk can hold.
    """

    def __init__(self, size: int):
        """Set the limit for a file of ``size`` bytes."""
        self._left = LEAST_TOTAL + LARGEST_RATIO * size

    def pieces(self, decompressor: Any, data: bytes) -> Iterator[bytes]:
        """Yield a chunk's content, with a decompressor as those of bz2, in pieces.

        `ExpansionError`: it has more than `LARGEST_CHUNK` bytes, or all chunks have too many.
        """
        total, piece = 0, b"\0"
        while piece and not decompressor.eof:
            piece = decompressor.decompress(data, max_length=_PIECE)
            data = b""
            total += len(piece)
            self._left -= len(piece)
            if total > LARGEST_CHUNK:
                raise ExpansionError(f"a chunk expands to more than {LARGEST_CHUNK / 1e6:.0f} MB")
            if self._left < 0:
                raise ExpansionError("its chunks expand to more than a hundred times its size")
            yield piece


class TopicError(Exception):
    """A topic that cannot be read; the text names it and what was expected."""


class BrokenOffError(Exception):
    """The file ends, or is damaged, within a record."""


def broken_off(path: Path, size: int, place: int, reason: object) -> str:
    """Return the sentence that a file of a size is read up to a place (bytes), and why."""
    return (
        f"{path} breaks off at {place / 1e6:.2f} of {size / 1e6:.2f} MB ({reason}), as after a "
        "crash: the rest is missing here"
    )


@dataclass(frozen=True)
class Connection:
    """A topic of one publisher."""

    #: topic, datatype, md5sum: As the publisher named them.
    topic: str
    datatype: str
    md5sum: str
    #: Name of the publishing node; empty if the bag does not have it.
    caller: str = field(default="", kw_only=True)

    def message_type(self) -> Any:
        """Return the class of the messages.

        `TopicError`: the type is not defined here, or is defined differently.
        """
        # The definition in the bag is not trusted: a class that is generated from it could run its
        # code.
        message_type = roslib.message.get_message_class(self.datatype)
        if message_type is None:
            raise TopicError(f"{self.topic} is omitted: no package here defines {self.datatype}")
        if message_type._md5sum != self.md5sum:
            raise TopicError(
                f"{self.topic} is omitted: its {self.datatype} has the md5 sum "
                f"{self.md5sum}, expected {message_type._md5sum}"
            )
        return message_type

    def deserializer(self) -> Callable[[bytes], Any]:
        """Return a function from data to message, which is valid until the next call.

        For `TopicError` see `message_type`.
        """
        # A new message each time would take three times as long.
        return self.message_type()().deserialize


class RecordFile:
    """A recording that is read once, from its beginning, as far as it is not damaged.

    ``source`` is the file itself, or what it was decompressed to.
    """

    _magic: bytes

    def __init__(self, path: Path, source: Path):
        self._path, self._source = path, source
        self.connections: list[Connection] = []  #: Connections that have been read so far.
        self.interruption = ""  #: Reason why reading has ended early; empty if it has not.
        self.size = source.stat().st_size
        self.done = 0  #: Number of bytes that have been read.
        self._expansion = Expansion(self.size)

    def messages(
        self, is_wanted: Callable[[Connection], bool]
    ) -> Iterator[tuple[Connection, float, bytes]]:
        """Yield connection, time of recording (s) and serialized message."""
        with self._source.open("rb") as file:
            file.seek(len(self._magic))
            try:
                yield from self._messages_in(file, self.size, is_wanted)
            except BrokenOffError as error:
                self.interruption = broken_off(self._path, self.size, file.tell(), error)
            except ExpansionError as error:
                self.interruption = f"{self._path} is read up to {self.done / 1e6:.2f} MB: {error}"
            # Damaged records, and decompressors, may raise any error.
            except Exception:
                self.interruption = broken_off(self._path, self.size, file.tell(), "it is damaged")

    def _messages_in(
        self, file: BinaryIO, end: int, is_wanted: Callable[[Connection], bool]
    ) -> Iterator[tuple[Connection, float, bytes]]:
        """Yield the messages in the records of a file, or of a chunk."""
        raise NotImplementedError


class BagFile(RecordFile):
    """A bag file; `BagError`: not a bag of version 2.0."""

    _magic = MAGIC

    def __init__(self, path: Path):
        super().__init__(path, path)
        self._by_id: dict[bytes, Connection | None] = {}  # None: not wanted.
        with path.open("rb") as file:
            start = file.read(len(MAGIC))
        if not start:
            raise BagError(f"{path} is empty; expected a bag, as rosbag record writes")
        if start.startswith(b"#ROSBAG V1"):
            raise BagError(f"{path} has the format {start[1:].decode().strip()}; run rosbag fix")
        if start != MAGIC:
            raise BagError(f"{path} is not a bag: it begins with {start!r}, expected {MAGIC!r}")

    @override
    def _messages_in(self, file, end, is_wanted):
        while file.tell() < end:
            fields = _fields(_sized(file, end))
            op = fields[b"op"]
            if op == _CHUNK:
                self.done = file.tell()
                # The size of a chunk that was not closed is 0: it extends to the end of the file.
                (size,) = _UINT32.unpack(file.read(4))
                content = file.read(size or -1)
                chunk = self._decompressed(content, fields[b"compression"])
                yield from self._messages_in(BytesIO(chunk), len(chunk), is_wanted)
                if len(content) != size:
                    raise BrokenOffError("its last chunk was not closed")
                continue
            data = _sized(file, end)
            if op == _MESSAGE:
                if (connection := self._by_id[fields[b"conn"]]) is not None:
                    seconds, nanoseconds = _TIME.unpack(fields[b"time"])
                    yield connection, seconds + nanoseconds * 1e-9, data
            elif op == _CONNECTION:
                self._connect(fields, data, is_wanted)
            elif op == _BAG_HEADER:
                self._check_index(*_UINT64.unpack(fields[b"index_pos"]))

    def _check_index(self, place):
        if place == 0:
            self.interruption = (
                f"{self._path} was not closed, as after a crash: the last second may be missing"
            )
        elif place > self.size:
            self.interruption = broken_off(self._path, self.size, self.size, "its index is missing")

    def _decompressed(self, data, compression):
        if compression == b"none":
            return data
        if compression not in DECOMPRESSORS:
            raise BrokenOffError(f"its compression is {compression.decode(errors='replace')}")
        try:
            # A truncated chunk is read as far as possible.
            return b"".join(self._expansion.pieces(DECOMPRESSORS[compression](), data))
        except (OSError, RuntimeError) as error:
            raise BrokenOffError(str(error)) from None

    def _connect(self, fields, data, is_wanted):
        if (key := fields[b"conn"]) in self._by_id:
            return
        texts = {name: value.decode(errors="replace") for name, value in _fields(data).items()}
        topic = fields[b"topic"].decode(errors="replace")
        caller = texts.get(b"callerid", "")
        connection = Connection(topic, texts[b"type"], texts[b"md5sum"], caller=caller)
        self.connections.append(connection)
        self._by_id[key] = connection if is_wanted(connection) else None


def _sized(file: BinaryIO, end: int) -> bytes:
    """Return the next part of a file that has so many bytes; its size is before it."""
    size = int.from_bytes(file.read(4), "little")
    if size > end - file.tell():
        raise BrokenOffError("it ends within a record")
    return file.read(size)


def _fields(header: bytes) -> dict[bytes, bytes]:
    """Return name and value of each field of a record's header."""
    fields = {}
    offset, end = 0, len(header)
    while offset < end:
        (size,) = _UINT32.unpack_from(header, offset)
        name, _, value = header[offset + 4 : offset + 4 + size].partition(b"=")
        fields[name] = value
        offset += 4 + size
    return fields
