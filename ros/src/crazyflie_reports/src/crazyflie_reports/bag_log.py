"""The messages of a recording, read once: numbers in files, events in memory."""

import os
from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from crazyflie_reports.bag_events import EventLog
from crazyflie_reports.bag_file import BagError, BagFile, Connection, TopicError
from crazyflie_reports.bag_ros2 import SUFFIXES, Ros2BagFile, expanded
from crazyflie_reports.bag_topics import (
    POSE_FIELDS,
    Topic,
    expected,
    placed,
    pose_row,
    seconds,
    topic_of,
)
from crazyflie_reports.mcap_file import McapFile, profile_of
from crazyflie_reports.usd_log import UsdConnection, UsdLogFile, is_usd_log

POSE_PERIOD = 0.009  #: Period of the transforms that are kept; they may come at 1 kHz (s).

#: ROS time, of 1973, below which times are simulated (s).
SIMULATED = 1e8

RESTART = 0.5  #: Step back of simulated time above which the simulation was restarted (s).

_BUFFER = 8192  # Numbers.


class Spool:
    """Rows of numbers, of which only the newest are in memory, and the others in a file.

    Each begins with the time of recording (s), the stamp (s; 0 without one) and the number in
    sequence; then it has ``fields``. The file is made when it is needed.
    """

    def __init__(self, path: Path, fields: tuple[str, ...], namespace: str = "", role: str = ""):
        self._path, self._width = path, len(fields)
        #: namespace, role: Vehicle and name of the role; empty for a frame.
        self.namespace, self.role = namespace, role
        self._buffer = array("d")
        self.count = 0  #: Number of rows.
        self.offset = 0.0  #: Offset that is added to the times of recording (s).
        self.last_time = float("-inf")

    def append(self, time: float, stamp: float, number: int, row: Sequence[float]) -> None:
        """Add a row of ``fields``."""
        self._buffer.extend((time, stamp, number, *row))
        self.count += 1
        self.last_time = time
        if len(self._buffer) >= _BUFFER:
            self._flush()

    def _flush(self):
        with self._path.open("ab") as file:
            self._buffer.tofile(file)
        del self._buffer[:]

    def rows(self) -> NDArray[np.float64]:
        """Return all rows in the order of their times, shape (count, 3 + len(fields))."""
        self._flush()
        rows = np.fromfile(self._path).reshape(-1, 3 + self._width)
        rows[:, 0] += self.offset
        # Merged bags may be in another order.
        is_sorted = (np.diff(rows[:, 0]) >= 0.0).all()
        return rows if is_sorted else rows[np.argsort(rows[:, 0], kind="stable")]


@dataclass
class BagLog:
    """The contents of a recording that a report needs."""

    name: str  #: Name of the recording.
    is_on_board: bool = False  #: Whether a vehicle has recorded it, on its micro SD card.
    sources: dict[str, Spool] = field(default_factory=dict)  #: By topic.
    frames: dict[str, Spool] = field(default_factory=dict)  #: `POSE_FIELDS` by child frame of /tf.
    events: EventLog = field(default_factory=EventLog)
    #: start, end: Times of the first and the last message that was read, s.
    start: float = float("inf")
    end: float = float("-inf")
    #: Remarks on data that are missing, or could not be read.
    remarks: list[str] = field(default_factory=list)


def name_of(path: Path) -> str:
    """Return the name of a recording: that of its file or folder, also of "." and ".."."""
    return os.path.basename(os.path.abspath(path))


def files_of(path: Path) -> list[Path]:
    """Return the files of a recording: those of a folder in their order, or the file itself.

    `BagError`: the path does not exist, or the folder has no bags.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise BagError(f"{path} does not exist; expected a bag or a folder of bags")
    names = (".bag", ".bag.active", *SUFFIXES)
    # flight_10.bag comes after flight_9.bag.
    bags = sorted(
        (each for each in path.iterdir() if each.name.endswith(names)),
        key=lambda each: (len(each.name.partition(".")[0]), each.name),
    )
    if not bags:
        raise BagError(
            f"{path} has no files *{', *'.join(names)}; expected the folder of a recording"
        )
    return bags


def read(path: Path, folder: Path, names: dict[str, str] | None = None) -> list[BagLog]:
    """Read a recording: a bag, or a folder of bags that follow each other, with a progress bar.

    The result is one log, or one for each start of simulated time. Series that are too long for
    memory are kept in ``folder`` as long as the logs are used. ``names`` has, by role, regular
    expressions of topics in place of the documented ones. `BagError`: the recording cannot be read,
    or has none of the topics.
    """
    name = name_of(path)
    reader = _Reader(name, folder, names or {})
    files = [_opened(each, folder) for each in files_of(path)]
    size = sum(file.size for file in files)
    with tqdm(total=size, unit="B", unit_scale=True, desc=name, disable=None) as bar:
        for file in files:
            done = 0.0
            for connection, time, data in file.messages(reader.is_wanted):
                reader.add(connection, time, data)
                if file.done != done:
                    bar.update(file.done - done)
                    done = file.done
    remarks = [file.interruption for file in files if file.interruption] + [*reader.remarks()]
    connections = [each for file in files for each in file.connections]
    if not connections:
        text = f"{path} has no messages; expected {expected()}"
        raise BagError("\n".join([text, *remarks]))
    logs = [each for each in reader.logs if each.sources or each.frames]
    if not logs:
        there = sorted({f"{each.topic} ({each.datatype})" for each in connections})
        text = f"{path} has no topics of a flight; expected {expected()}, or /tf."
        raise BagError("\n".join([text, f"There are: {', '.join(there)}", *remarks]))
    logs[0].remarks += remarks
    for number, log in enumerate(logs, 1):
        log.is_on_board = isinstance(files[0], UsdLogFile)
        if len(logs) > 1:
            log.name = f"{name}, start {number} of {len(logs)}"
    return logs


def _opened(path, folder):
    try:
        source = expanded(path, folder)
        if source.suffix == ".mcap" and profile_of(source) not in (None, "ros2"):
            return McapFile(path, source)
        if path.name.endswith(SUFFIXES):
            return Ros2BagFile(path, source)
        return UsdLogFile(path) if is_usd_log(path) else BagFile(path)
    except OSError as error:
        raise BagError(f"{path}: {error.strerror}") from None


class _Reader:
    """Adds messages to series and events."""

    def __init__(self, name: str, folder: Path, names: dict[str, str]):
        self._name, self._folder, self._names = name, folder, names
        self.logs = [BagLog(name)]
        self._newest: dict[str, float] = {}  # By topic, s.
        self._topics: dict[Connection, Topic] = {}
        self._errors: dict[str, str] = {}
        self._bad: Counter[str] = Counter()

    def is_wanted(self, connection):
        try:
            is_usd = isinstance(connection, UsdConnection)
            topic = connection.entry() if is_usd else topic_of(connection, self._names)
        except TopicError as error:
            self._errors[connection.topic] = str(error)
            return False
        if topic is not None:
            self._topics[connection] = topic
        return topic is not None

    def add(self, connection, time, data):
        topic = self._topics[connection]
        # Each topic separately: merged bags may have one after the other.
        newest = self._newest.get(connection.topic, time)
        if time < newest - RESTART and newest < SIMULATED:
            self.logs.append(BagLog(self._name))
            self._newest, newest = {}, time
        self._newest[connection.topic] = max(time, newest)
        log = self.logs[-1]
        log.start, log.end = min(log.start, time), max(log.end, time)
        try:
            stamp, number, content = topic.decode(data)
            if (role := topic.role) is not None:
                owner = topic.namespace, role.name
                spool = self._spool(log.sources, connection.topic, role.fields, *owner)
                spool.append(time, stamp, number, content)
            elif hasattr(content, "transforms") or hasattr(content, "poses"):
                self._add_transforms(time, content)
            else:
                names = connection.topic, topic.namespace, connection.datatype
                log.events.add(time, *names, content)
        except Exception as error:  # Damaged fields of a bag may raise any error.
            self._errors.setdefault(connection.topic, f"{connection.topic}: {error}")
            self._bad[connection.topic] += 1

    def remarks(self):
        for topic, text in self._errors.items():
            count = self._bad[topic]
            yield f"{count} messages of {text}" if count else text
        if dropped := sum(each.events.dropped for each in self.logs):
            yield f"{dropped} more events are left out"

    def _add_transforms(self, time, message):
        for frame, stamp, row in _poses_of(message):
            spool = self._spool(self.logs[-1].frames, frame, POSE_FIELDS)
            if time - spool.last_time >= POSE_PERIOD:
                spool.append(time, seconds(stamp), 0, row)

    def _spool(self, spools, key, fields, *owner):
        if key not in spools:
            number = sum(len(each.sources) + len(each.frames) for each in self.logs)
            spools[key] = Spool(self._folder / f"{number}.doubles", fields, *owner)
        return spools[key]


def _poses_of(message):
    """Yield frame, stamp and row of each pose in a message of /tf, or of motion capture."""
    if hasattr(message, "poses"):
        for each in message.poses:
            yield each.name, message.header.stamp, pose_row(each.pose)
        return
    for each in message.transforms:
        row = placed(each.transform.translation, each.transform.rotation)
        yield each.child_frame_id.strip("/"), each.header.stamp, row
