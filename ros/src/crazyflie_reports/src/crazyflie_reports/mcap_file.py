"""Messages of an MCAP file of another profile than ros2, such as a bag after ``mcap convert``.

rosbags reads the profile ros2 only. As a bag, the file is read from its beginning to its end,
without its index: a file that is cut is read as far as possible.
Format: https://mcap.dev/spec, https://mcap.dev/spec/registry.
"""

import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import roslib.message
from typing_extensions import override

from crazyflie_reports.bag_file import (
    BrokenOffError,
    Connection,
    RecordFile,
    TopicError,
)
from crazyflie_reports.bag_ros2 import MCAP_MAGIC, Ros2Connection, chunk_content

_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 1, 2, 3, 4, 5, 6, 15
_OTHER_SUM = "{} does not have the check sum that was written"
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


class McapFile(RecordFile):
    """An MCAP file; ``source`` is the file itself, or what `bag_ros2.expanded` has made of it."""

    _magic = MCAP_MAGIC

    def __init__(self, path: Path, source: Path):
        super().__init__(path, source)
        self._schemas: dict[int, tuple[str, str]] = {}  # Name and definition.
        self._channels: dict[int, Connection | None] = {}  # None: not wanted.

    @override
    def _messages_in(self, file, end, is_wanted, is_chunk=False):
        sums = [zlib.crc32(self._magic), 0]  # From the beginning, and after the header.
        while file.tell() < end:
            kind, size = _RECORD.unpack(head := _exactly(file, _RECORD.size))
            data = file.read(min(size, end - file.tell()))
            if kind == _DATA_END and int.from_bytes(data[:4], "little") not in (0, *sums):
                self.interruption = f"{self._path} is damaged: {_OTHER_SUM.format('its data')}"
            if kind in (_DATA_END, _FOOTER):
                return
            if not is_chunk:
                sums = [zlib.crc32(data, zlib.crc32(head, each)) for each in sums]
                sums[1] *= kind != _HEADER
            if kind == _CHUNK and not is_chunk:
                self.done = file.tell()
                content = b"".join(chunk_content(data, self._expansion))
                if len(data) == size and _chunk_sum(data) not in (0, zlib.crc32(content)):
                    raise BrokenOffError(_OTHER_SUM.format("a chunk"))
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


def _chunk_sum(data):
    return int.from_bytes(data[24:28], "little")


def _exactly(file, size):
    data = file.read(size)
    if len(data) < size:
        raise BrokenOffError("it ends within a record")
    return data


def _number(file, size):
    return int.from_bytes(_exactly(file, size), "little")


def _text(file):
    return _exactly(file, _number(file, 4)).decode(errors="replace")
