"""What the nodes of a flight were given: messages, calls, parameters; of a bag, or journals."""

import json
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import Any

import genpy
import roslib.message
import rospkg
import yaml
from roslaunch.core import RLException

from crazyflie_reports.bag_file import BagError, BagFile, TopicError
from crazyflie_reports.bag_log import files_of
from crazyflie_reports.bag_ros2 import SUFFIXES
from crazyflie_reports.recorder import PARAMETERS
from crazyflie_utils import launch_file
from crazyflie_utils.journal.journal_file import (
    SUFFIX,
    Journal,
    JournalError,
    Kind,
    SourcesError,
    received,
)
from crazyflie_utils.journal.recording import plain_type, serialized
from crazyflie_utils.journal.replay import Replay
from crazyflie_utils.journal.replay_transport import DifferenceError, EndError, Rows

COMPOSED = "/composed"  #: The process of all nodes, if they are in one.


class InputError(Exception):
    """A recording, a node or a parameter cannot be used; the text says why."""


@dataclass(frozen=True)
class Given:
    """A recorded message."""

    time: float  #: When it arrived (s).
    topic: str
    message_type: Any
    data: bytes
    caller: str  #: Name of the publishing node; empty if it is not known.
    order: float = 0.0  #: Place among the messages of the same time, in one process.

    def message(self) -> genpy.Message:
        """Return the message, a new one each time."""
        return self.message_type().deserialize(self.data)


@dataclass
class FlightInput:
    """What the nodes of a flight were given."""

    messages: list[Given]
    parameters: dict[str, Any]  #: Full name to raw value.
    classes: dict[str, str]  #: "package.module:Class" by full name of a node.
    #: Time (s), service and request of each call.
    calls: list[tuple[float, str, genpy.Message]] = field(default_factory=list)
    remappings: dict[str, str] = field(default_factory=dict)  #: As those of a launch file.
    remarks: list[str] = field(default_factory=list)


def of_launch_file(
    launch: str, arguments: Sequence[str], recording: Path, vehicle: str
) -> FlightInput:
    """Return nodes and parameters of a launch file, with the parameters of a recording.

    ``launch`` is a path, or "PACKAGE/FILE" with a file of the package's folder ``launch``; its
    arguments are as "NAME:=VALUE". A recording is a folder with `PARAMETERS`, or a bag in it;
    without them the launch file's hold. Those of a ``vehicle`` are below its namespace; its topics
    keep the launch file's names.
    """
    path = Path(launch)
    try:
        if not path.is_file():
            package, _, name = launch.partition("/")
            path = Path(rospkg.RosPack().get_path(package)) / "launch" / name
        given = {"composed": "true", "rviz": "false"} | dict(
            each.split(":=", 1) for each in arguments
        )
        problems = launch_file.unknown_arguments([str(path), *arguments])
        _, parameters = launch_file.expand(path, **given)
    except (rospkg.ResourceNotFound, RLException, OSError, ValueError) as error:
        raise InputError(f"--launch {launch} cannot be read: {error}") from None
    if problems:
        raise InputError("; ".join(problems))
    found = FlightInput([], parameters, {})
    file = (recording if recording.is_dir() else recording.parent) / PARAMETERS
    recorded: dict[str, Any] = {}
    if file.is_file():
        try:
            recorded = dict(_leaves(yaml.safe_load(file.read_text(encoding="utf-8"))))
        except (OSError, ValueError, yaml.YAMLError) as error:
            raise InputError(f"{file} cannot be read: {error}") from None
    else:
        found.remarks.append(f"parameters: those of {path.name}, as {file} does not exist")
    classes = (not vehicle and launch_file.composed_nodes(recorded)) or (
        launch_file.composed_nodes(parameters)
    )
    if not classes:
        raise InputError(f"--launch {launch} lists no nodes with composed:=true")
    found.classes = {f"/{name}": each for name, each in classes.items()}
    top = f"/{vehicle}" if vehicle else ""
    for name, value in recorded.items():
        own = name.removeprefix(top)
        is_name = any(part in own for part in ("/topics/", "/srv/"))
        if own.startswith(tuple(f"{node}/" for node in found.classes)) and not (top and is_name):
            parameters[own] = value
    return found


def read_bag(
    path: Path, vehicle: str, is_wanted: Callable[[str], bool], found: FlightInput
) -> None:
    """Add the messages of a bag of ROS 1, or a folder of bags, on topics that are wanted.

    ``is_wanted(topic)`` is asked with the names that they have below the namespace of the
    ``vehicle``. `BagError`: it cannot be read.
    """
    top = f"/{vehicle}/" if vehicle else "/"
    types: dict[Any, Any] = {}

    def name_of(topic: str) -> str:
        topic = "/" + topic.lstrip("/")
        return "/" + topic.removeprefix(top).lstrip("/")

    def wants(connection: Any) -> bool:
        if not is_wanted(name_of(connection.topic)):
            return False
        try:
            types[connection] = connection.message_type()
        except TopicError as error:
            found.remarks.append(str(error))
            return False
        return True

    for each in files_of(path):
        if each.name.endswith(SUFFIXES):
            raise BagError(f"{each} is a bag of ROS 2; expected one of ROS 1, or a journal")
        try:
            file = BagFile(each)
        except OSError as error:
            raise BagError(f"{each}: {error.strerror}") from None
        for connection, time, data in file.messages(wants):
            given = Given(
                time, name_of(connection.topic), types[connection], data, connection.caller
            )
            found.messages.append(given)
        if file.interruption:
            found.remarks.append(file.interruption)
    # Merged bags may have one after the other.
    found.messages.sort(key=lambda given: given.time)


def _leaves(tree: Any, name: str = "") -> Iterable[tuple[str, Any]]:
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from _leaves(value, f"{name}/{str(key).strip('/')}")
    elif name:
        yield name, tree
    elif tree is not None:
        raise ValueError("it is not a dictionary of parameters")


def journals_of(path: Path) -> list[Path]:
    """Return the journals in a folder, or the one that a path names; none for anything else."""
    if path.is_dir():
        return sorted(path.glob(f"*{SUFFIX}"))
    return [path] if path.name.endswith(SUFFIX) and path.is_file() else []


def of_journals(paths: list[Path]) -> FlightInput:
    """Return what the processes of journals were given, and what they published.

    The latter is found by running their nodes again; what they publish after something that today's
    nodes do otherwise is not known. `JournalError`: one is not a journal.
    """
    found = FlightInput([], {}, {})
    series: dict[str, list[Given]] = {}
    outputs: dict[str, list[Given]] = {}
    for path in paths:
        journal = Journal(path)
        given = _JournalInput(journal)
        if given.has_no_times:
            raise InputError(
                f"{path} is of a process that publishes /clock itself: its messages have no times; "
                "expected one with another clock, or a bag"
            )
        sent = _published_again(Journal(path), found)
        for topic, datatype in given.outdated.items():
            found.remarks.append(
                f"{path.name}: messages on {topic} are left out: they are of another version of "
                f"{datatype} than today's"
            )
        if given.unnamed:
            found.remarks.append(
                f"{path.name}: {given.unnamed} messages and calls are left out: their topics were "
                "registered by a thread, and are not known"
            )
        if journal.damage:
            found.remarks.append(f"{path.name} is read to where {journal.damage}")
        found.parameters = {**dict(given.parameters), **found.parameters}
        found.classes.update(given.launched)
        found.remappings.update(given.remappings)
        found.calls += given.calls
        # Several nodes of a graph have received the same messages.
        for topic, messages in given.series():
            if len(messages) > len(series.get(topic, ())):
                series[topic] = messages
        for topic, messages in sent.items():
            outputs.setdefault(topic, messages)
    composed = launch_file.composed_nodes(found.parameters)
    found.classes = {f"/{name}": each for name, each in composed.items()} | found.classes
    both = (outputs | series).values()
    found.messages = sorted((g for each in both for g in each), key=attrgetter("time", "order"))
    found.calls.sort(key=lambda call: call[0])
    return found


class _JournalInput:
    """Inputs of one process, from the rows of its journal, without running anything."""

    def __init__(self, journal: Journal):
        self.parameters: list[tuple[str, Any]] = []
        self.launched: dict[str, str] = {}
        self.remappings: dict[str, str] = {}
        self.calls: list[tuple[float, str, genpy.Message]] = []
        #: Messages and calls of topics and services without a name: they were registered by a
        #: thread, as a driver's are when a vehicle is added.
        self.unnamed = 0
        #: Topics whose messages are of another version of their type than today's, and the type.
        self.outdated: dict[str, str] = {}
        self._messages: dict[int, list[Given]] = {}
        self._rows, self._clock = Rows(journal), journal.header["clock"]
        self._simulated = 0.0  # The latest time on /clock, s.
        while self._rows.next is not None:
            row = self._rows.next
            try:
                self._take(self._rows.take())
            except (ValueError, LookupError, TypeError, struct.error, genpy.DeserializationError):
                raise JournalError(f"{journal.path}: a {row.kind.name} cannot be read") from None

    @property
    def has_no_times(self) -> bool:
        """Whether the process had simulated time, and got none."""
        return self._clock == "simulated" and not self._simulated

    def _time(self):
        """Return the ROS time of the present input, s."""
        if self._clock == "simulated":
            return self._simulated
        own = self._rows.us * 1e-6 if self._clock == "steady" else self._rows.moment
        return own + self._rows.wall_offset * 1e-9

    def series(self) -> Iterator[tuple[str, list[Given]]]:
        """Yield topic and messages of each subscription."""
        for messages in self._messages.values():
            yield messages[0].topic, messages

    def _take(self, row):
        names = self._rows.names
        if row.kind is Kind.MESSAGE:
            self._add(row)
        elif row.kind is Kind.VALUE:
            what, is_value, *rest = json.loads(row.data)
            if is_value and what.startswith("/"):
                # The first value is that of the start.
                tree = rest[0] if isinstance(rest[0], dict) else {"": rest[0]}
                self.parameters[:0] = [
                    (f"{what}{name}".rstrip("/"), value) for name, value in _leaves(tree, "")
                ]
        elif row.kind is Kind.NAME:
            name, mapped = json.loads(row.data)
            self.remappings[name] = mapped
        elif row.kind is Kind.LAUNCH:
            name, path = json.loads(row.data)
            self.launched[name] = path
        elif row.kind is Kind.CALL and row.number not in names[Kind.OFFERED]:
            self.unnamed += 1
        elif row.kind is Kind.CALL:
            name, kind = names[Kind.OFFERED][row.number]
            service_type = roslib.message.get_service_class(kind)
            request = service_type._request_class().deserialize(row.data)
            self.calls.append((self._time(), name, request))

    def _add(self, row):
        names = self._rows.names
        if row.number not in names[Kind.SUBSCRIBED]:
            self.unnamed += 1
            return
        topic, datatype = names[Kind.SUBSCRIBED][row.number]
        message_type = roslib.message.get_message_class(datatype)
        if message_type is None:
            raise ValueError(datatype)
        connection, _, data = received(row)
        if topic == "/clock" and self._clock == "simulated":
            self._simulated = message_type().deserialize(data).clock.to_sec()
        if row.number not in self._messages:
            try:
                message_type().deserialize(data)
            except genpy.DeserializationError:
                self.outdated[topic] = datatype
                return
        caller = names[Kind.CALLER].get(connection, [""])[0]
        given = Given(self._time(), topic, message_type, data, caller, self._rows.inputs)
        self._messages.setdefault(row.number, []).append(given)


def _published_again(journal: Journal, found: FlightInput) -> dict[str, list[Given]]:
    """Return what the nodes of a journal publish when they run again, by topic."""
    sent: dict[str, list[Given]] = {}
    node = journal.header["node"]

    def note(topic: str, message: genpy.Message) -> None:
        # What is published at the start is published again; the clock is not known yet.
        if replay.input is None:
            return
        data, kind = serialized(message), plain_type(type(message))
        time = _time_of(replay, journal.header)
        # Behind what has led to it.
        given = Given(time, topic, kind, data, node, replay.rows.inputs + 0.5)
        sent.setdefault(topic, []).append(given)

    try:
        with Replay(journal) as replay:
            replay.transport.on_publish = note
            is_running = replay.start()
            found.classes.update(
                {name: _path_of(each) for name, each in replay.nodes.items() if is_running}
            )
            while is_running and replay.step():
                pass
    except SourcesError as error:
        found.remarks.append(f"what it published is not known: {error}")
    except (JournalError, DifferenceError) as error:
        found.remarks.append(
            f"{journal.path.name}: what was published after {replay.rows.time:.3f} s is not known, "
            f"since today's nodes do something else: {error}"
        )
    except EndError:
        pass  # The process was killed in a callback.
    return sent


def _time_of(replay, header):
    """Return the ROS time of the present input, s; a clock that is asked would read on."""
    rows = replay.rows
    if header["clock"] == "steady":
        return rows.us * 1e-6 + rows.wall_offset * 1e-9
    clock = replay.process.clock
    return clock.time() + (clock.wall_offset if header["clock"] == "manual" else 0.0)


def _path_of(node):
    return f"{type(node).__module__}:{type(node).__qualname__}"
