"""Messages of an MCAP file of another profile than ros2, such as a bag after ``mcap convert``.

rosbags reads the profile ros2 only. As a bag, the file is read from its beginning to its end,
without its index: a file that is cut is read as far as possible.
Format: https://mcap.dev/spec, https://mcap.dev/spec/registry.
"""

import re
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import roslib.message
from typing_extensions import override

from crazyflie_reports.bag_file import (
    BrokenOffError,
    Connection,
    Expansion,
    ExpansionError,
    TopicError,
    broken_off,
)
from crazyflie_reports.bag_ros2 import MCAP_MAGIC, Ros2Connection, chunk_content

_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END, _FOOTER = 0x03, 0x04, 0x05, 0x06, 0x0F, 0x02
_RECORD, _MESSAGE_HEAD = struct.Struct("<BQ"), struct.Struct("<HIQQ")
_LARGEST_PROFILE = 100  # Length of the text that names the profile (bytes).


def profile_of(path: Path) -> str | None:
    """Return the profile of an MCAP file, such as "ros1"; None if it is not one."""
    with path.open("rb") as file:
        start = file.read(len(MCAP_MAGIC) + _RECORD.size + 4 + _LARGEST_PROFILE)
    if not start.startswith(MCAP_MAGIC):
        return None
    try:
        return _text(BytesIO(start[len(MCAP_MAGIC) + _RECORD.size :]))
    except BrokenOffError:
        return None


@dataclass(frozen=True)
class Ros1Connection(Connection):
    """A topic with messages of ROS 1; without an md5 sum, definitions are compared."""

    definition: str = ""  #: Definition in the file.

    @override
    def deserializer(self) -> Callable[[bytes], Any]:
        if self.md5sum:
            return super().deserializer()
        kind = roslib.message.get_message_class(self.datatype)
        if kind is not None and _fields(kind._full_text) != _fields(self.definition):
            raise TopicError(
                f"{self.topic} is omitted: its {self.datatype} has other fields than the one here"
            )
        known = "" if kind is None else kind._md5sum
        return Connection(self.topic, self.datatype, known).deserializer()


@dataclass(frozen=True)
class _OtherConnection(Connection):
    encoding: str = ""

    @override
    def deserializer(self) -> Callable[[bytes], Any]:
        encoding = self.encoding or "not named"
        raise TopicError(f"{self.topic} is omitted: its encoding is {encoding}; expected ros1, cdr")


def _fields(definition):
    """Return the lines of a definition without comments, in the order of the file."""
    lines = (re.sub("#.*", "", line).split() for line in definition.splitlines())
    return [line for line in lines if line]


class McapFile:
    """An MCAP file that is read once, from its beginning, as `bag_file.BagFile`.

    ``source`` is the file itself, or what `bag_ros2.expanded` has made of it.
    """

    def __init__(self, path: Path, source: Path):
        self._path, self._source = path, source
        self.connections: list[Connection] = []  #: Connections that have been read so far.
        self.interruption = ""  #: Reason why reading has ended early; empty if it has not.
        self.size = source.stat().st_size
        self.done = 0  #: Number of bytes that have been read.
        self._expansion = Expansion(self.size)
        self._schemas: dict[int, tuple[str, str]] = {}  # Name and definition.
        self._channels: dict[int, Connection | None] = {}  # None: not wanted.

    def messages(
        self, is_wanted: Callable[[Connection], bool]
    ) -> Iterator[tuple[Connection, float, bytes]]:
        """Yield connection, time of recording (s) and serialized message."""
        with self._source.open("rb") as file:
            file.seek(len(MCAP_MAGIC))
            try:
                yield from self._messages_in(file, self.size, is_wanted)
            except BrokenOffError as error:
                self.interruption = broken_off(self._path, self.size, file.tell(), error)
            except ExpansionError as error:
                self.interruption = f"{self._path} is read up to {self.done / 1e6:.2f} MB: {error}"
            # A decompressor may raise any error.
            except Exception:
                self.interruption = broken_off(self._path, self.size, file.tell(), "it is damaged")

    def _messages_in(self, file, end, is_wanted, is_chunk=False):
        """Yield the messages in the records of a file, or of a chunk."""
        while file.tell() < end:
            kind, size = _RECORD.unpack(_exactly(file, _RECORD.size))
            if kind in (_DATA_END, _FOOTER):
                return
            data = file.read(min(size, end - file.tell()))
            if kind == _CHUNK and not is_chunk:
                self.done = file.tell()
                content = b"".join(chunk_content(data, self._expansion))
                yield from self._messages_in(BytesIO(content), len(content), is_wanted, True)
            if len(data) < size:
                raise BrokenOffError("it ends within a record")
            if kind == _MESSAGE:
                number, _, time, _ = _MESSAGE_HEAD.unpack_from(data)
                if (connection := self._channels[number]) is not None:
                    yield connection, time * 1e-9, data[_MESSAGE_HEAD.size :]
            elif kind == _SCHEMA:
                self._add_schema(BytesIO(data))
            elif kind == _CHANNEL:
                self._add_channel(BytesIO(data), is_wanted)
        if not is_chunk:
            raise BrokenOffError("its end is missing")

    def _add_schema(self, data):
        number = _number(data, 2)
        name, _ = _text(data), _text(data)
        self._schemas[number] = name.replace("/msg/", "/"), _text(data)

    def _add_channel(self, data, is_wanted):
        number, schema = _number(data, 2), _number(data, 2)
        if number in self._channels:
            return
        topic, encoding = _text(data), _text(data)
        metadata = BytesIO(_exactly(data, _number(data, 4)))
        values = {}
        while metadata.tell() < len(metadata.getbuffer()):
            key = _text(metadata)
            values[key] = _text(metadata)
        datatype, definition = self._schemas.get(schema, ("", ""))
        connection: Connection
        if encoding == "ros1":
            connection = Ros1Connection(topic, datatype, values.get("md5sum", ""), definition)
        elif encoding == "cdr":
            connection = Ros2Connection(topic, datatype, "", definition)
        else:
            connection = _OtherConnection(topic, datatype, "", encoding)
        self.connections.append(connection)
        self._channels[number] = connection if is_wanted(connection) else None


def _exactly(file, size):
    data = file.read(size)
    if len(data) < size:
        raise BrokenOffError("it ends within a record")
    return data


def _number(file, size):
    return int.from_bytes(_exactly(file, size), "little")


def _text(file):
    return _exactly(file, _number(file, 4)).decode(errors="replace")
