"""Messages of ROS 2 bags: files of sqlite3 and of MCAP, read by PyPI's rosbags.

rosbags executes code that it generates from message definitions (`Typestore.register`,
`get_msgdef`), and its AnyReader uses those in the bag. Here a store has the definitions of rosbags,
the installed ones, and those below; the ones in a bag are only parsed and compared with them.
Formats: https://mcap.dev/spec, https://github.com/ros2/rosbag2.
"""

import struct
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import roslib.message
from rosbags.interfaces import MessageDefinitionFormat, Nodetype
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from crazyflie_reports.bag_file import (
    BagError,
    Connection,
    Expansion,
    ExpansionError,
    TopicError,
)

#: Part of Python from 3.14 on.
zstd = import_module("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")

SUFFIXES = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")

#: Types of crazyswarm2 and its motion capture, which no package here defines.
FOREIGN = {
    "crazyflie_interfaces/FullState": (
        "std_msgs/Header header\ngeometry_msgs/Pose pose\ngeometry_msgs/Twist twist\n"
        "geometry_msgs/Vector3 acc\n"
    ),
    "crazyflie_interfaces/Position": (
        "std_msgs/Header header\nfloat32 x\nfloat32 y\nfloat32 z\nfloat32 yaw\n"
    ),
    "crazyflie_interfaces/Status": (
        "std_msgs/Header header\nuint16 supervisor_info\nfloat32 battery_voltage\nuint8 pm_state\n"
        "uint8 rssi\nuint32 num_rx_broadcast\nuint32 num_tx_broadcast\nuint32 num_rx_unicast\n"
        "uint32 num_tx_unicast\nuint16 latency_unicast\n"
    ),
    "motion_capture_tracking_interfaces/NamedPose": "string name\ngeometry_msgs/Pose pose\n",
    "motion_capture_tracking_interfaces/NamedPoseArray": (
        "std_msgs/Header header\nmotion_capture_tracking_interfaces/NamedPose[] poses\n"
    ),
}

# Largest length of a definition (characters): the parser's time grows with its square.
_LARGEST_DEFINITION = 20_000
MCAP_MAGIC = b"\x89MCAP0\r\n"
_CHUNK = 0x06  # The record of MCAP with compressed messages.
_ZSTD = b"\x28\xb5\x2f\xfd"  # A message of CDR begins with 0.
_RECORD = struct.Struct("<BQ")

_DECOMPRESSORS = {"zstd": zstd.ZstdDecompressor, "lz4": lz4.frame.LZ4FrameDecompressor}


@cache
def types() -> Typestore:
    """Return the known definitions, of ROS 2 and of crazyswarm2; others are added later."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in FOREIGN.items():
        store.register(get_types_from_msg(text, ros2_name(name)))
    return store


def known(datatype: str) -> bool:
    """Return whether a type ("package/Name") is defined; adds an installed definition."""
    name, store = ros2_name(datatype), types()
    if name not in store.fielddefs and (installed := roslib.message.get_message_class(datatype)):
        # ROS 1's Header is different.
        parsed = get_types_from_msg(installed._full_text, name)
        store.register({k: v for k, v in parsed.items() if k not in store.fielddefs})
    return name in store.fielddefs


def ros2_name(datatype: str) -> str:
    """Return the name of a type in ROS 2: "package/msg/Name" of "package/Name"."""
    package, _, name = datatype.partition("/")
    return f"{package}/msg/{name}"


def message(datatype: str, fields: Any = ()) -> Any:
    """Return a message of ROS 2 with some fields, by name or in their order; others are 0 or empty.

    A message in a field is given by its fields, too.
    """
    message_type, kinds = _type(datatype)
    given = fields if isinstance(fields, dict) else dict(zip(kinds, fields, strict=False))
    values = dict.fromkeys(kinds) | given
    return message_type(**{field: _value(kinds[field], value) for field, value in values.items()})


@cache
def _type(datatype):
    if not known(datatype):
        raise KeyError(datatype)
    name = ros2_name(datatype)
    return types().types[name], dict(types().fielddefs[name][1])


def _value(kind, given):
    if kind[0] == Nodetype.NAME:
        return message(kind[1].replace("/msg/", "/"), () if given is None else given)
    if kind[0] == Nodetype.BASE:
        zero = "" if kind[1][0] == "string" else False if kind[1][0] == "bool" else 0
        return zero if given is None else given
    element, length = kind[1]
    is_number = element[0] == Nodetype.BASE and element[1][0] != "string"
    if is_number and given is None:
        return np.zeros(length, element[1][0])
    return given if is_number else [_value(element, each) for each in given or ()]


@dataclass(frozen=True)
class Ros2Connection(Connection):
    """A topic of a ROS 2 bag."""

    definition: str = ""  #: Definition in the bag; "" if it has none.

    def deserializer(self) -> Callable[[bytes], Any]:
        """Return what makes a message of its data.

        `TopicError`: the type is not known here, or has other fields.
        """
        if not known(self.datatype):
            raise TopicError(f"{self.topic} is omitted: no package here defines {self.datatype}")
        store, name = types(), ros2_name(self.datatype)
        if self.definition:
            try:
                other = get_types_from_msg(self.definition[:_LARGEST_DEFINITION], name)
            except (TypesysError, RecursionError):
                other = {name: ([], [])}
            for each in other.keys() & store.fielddefs.keys():
                if other[each][1] != store.fielddefs[each][1]:
                    there, here = _fields(other[each]), _fields(store.fielddefs[each])
                    raise TopicError(
                        f"{self.topic} is omitted: {each} has the fields {there}; expected {here}"
                    )
        return lambda data: store.deserialize_cdr(data, name)


def _fields(definition):
    return ", ".join(f"{kind[1]} {name}" for name, kind in definition[1]) or "none"


def expanded(path: Path, folder: Path) -> Path:
    """Return a file that is compressed as a whole, such as x.mcap.zstd, decompressed in ``folder``.

    Another file is returned as it is. `BagError`: it is damaged, or too large.
    """
    if path.suffix != ".zstd":
        return path
    target = Path(tempfile.mkdtemp(dir=folder)) / path.stem
    decompressor, expansion = zstd.ZstdDecompressor(), Expansion(path.stat().st_size)
    try:
        with path.open("rb") as source, target.open("wb") as file:
            while (data := source.read(1 << 20)) and not decompressor.eof:
                file.writelines(expansion.pieces(decompressor, data))
    except (ExpansionError, zstd.ZstdError) as error:
        raise BagError(f"{path} cannot be read: {error}") from None
    return target


class Ros2BagFile:
    """A file of a ROS 2 bag, as `bag_file.BagFile` is one of ROS 1.

    ``source`` is the file itself, or what `expanded` has made of it. `BagError`: it cannot be read.
    """

    def __init__(self, path: Path, source: Path):
        self._path = path
        self.connections: list[Connection] = []
        self.interruption = ""  #: Reason why reading has ended early; empty if it has not.
        self.size = path.stat().st_size
        self.done = 0.0  #: Number of bytes that have been read, estimated by that of messages.
        self._expansion = Expansion(self.size)
        self._source = source
        try:
            checked = self._checked_chunks() if self._source.suffix == ".mcap" else set()
            self._reader = Reader(self._source)
            self._reader.open()
            index = getattr(self._reader.storage, "chunks", ())
            if {(c.chunk_start_offset, c.compression, c.compressed_size) for c in index} - checked:
                raise ReaderError("its index has a chunk that is not in the file")
        except Exception as error:  # rosbags may raise any error on a damaged file.
            is_open = self._source.suffix == ".mcap" and not isinstance(error, ExpansionError)
            hint = "; mcap recover mends a file that was not closed" if is_open else ""
            raise BagError(
                f"{path} cannot be read: {error or type(error).__name__}{hint}"
            ) from None
        self._originals = {}
        for each in self._reader.connections:
            is_text = each.msgdef.format == MessageDefinitionFormat.MSG
            definition = each.msgdef.data if is_text else ""
            datatype = each.msgtype.replace("/msg/", "/")
            connection = Ros2Connection(each.topic, datatype, each.digest, definition)
            self.connections.append(connection)
            self._originals[each.id] = connection

    def messages(
        self, is_wanted: Callable[[Connection], bool]
    ) -> Iterator[tuple[Connection, float, bytes]]:
        """Yield connection, time of recording (s) and serialized message, in the order of times."""
        wanted = [c for c in self._reader.connections if is_wanted(self._originals[c.id])]
        share = self.size / max(1, self._reader.message_count)
        try:
            for each, time, data in self._reader.messages(wanted) if wanted else ():
                if data[:4] == _ZSTD:
                    data = b"".join(self._expansion.pieces(zstd.ZstdDecompressor(), data))
                yield self._originals[each.id], time * 1e-9, data
                self.done += share
        except ExpansionError as error:
            self.interruption = f"{self._path} is read in part: {error}"
        except Exception as error:  # rosbags may raise any error on a damaged file.
            self.interruption = f"{self._path} is damaged, and is read in part: {error}"
        finally:
            self._reader.close()

    def _checked_chunks(self) -> set[tuple[int, str, int]]:
        """Return place, compression and size of each chunk, all within the limits.

        rosbags decompresses each as a whole. `ExpansionError`: one chunk, or all together, exceed
        the limit.
        """
        found = set()
        with self._source.open("rb") as file:
            file.seek(len(MCAP_MAGIC))
            while len(head := file.read(_RECORD.size)) == _RECORD.size:
                kind, size = _RECORD.unpack(head)
                begin = file.tell()
                if begin + size > self._source.stat().st_size:
                    break  # rosbags reports that itself.
                if kind == _CHUNK:
                    data = file.read(size)
                    name, content = _chunk(data)
                    found.add((begin - _RECORD.size, name, len(content)))
                    for _ in chunk_content(data, self._expansion):
                        pass
                file.seek(begin + size)
        return found


def _chunk(data):
    """Return compression and compressed records of a chunk's record."""
    (length,) = struct.unpack_from("<I", data, 28)
    return data[32 : 32 + length].decode(), data[40 + length :]


def chunk_content(data: bytes, expansion: Expansion) -> Iterator[bytes]:
    """Yield the records in a chunk's record of MCAP, in pieces.

    `ExpansionError`: they exceed the limit. ValueError: the compression is not known.
    """
    name, content = _chunk(data)
    if name and name not in _DECOMPRESSORS:
        raise ValueError(f"the compression of a chunk is {name!r}")
    while content and name:
        decompressor = _DECOMPRESSORS[name]()
        yield from expansion.pieces(decompressor, content)
        content = decompressor.unused_data  # The next frame.
    if not name:
        yield content
