"""Writes the journal of a process: what it is given by its clock, its transport and its threads.

Everything that comes from outside is passed on in turn with all other work, as an input, and is
written when its turn comes; so is everything that callbacks read, and a checksum of every message
that they publish. Other threads read and publish without being recorded. Callbacks are given what
was written: a float32 has the digits that it has on the wire.

While an input is processed, the clock stands still: callbacks see the moment at which it began.
"""

import builtins
import json
import struct
import time
import zlib
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from enum import Enum
from functools import partial
from itertools import count
from threading import get_ident
from types import MappingProxyType, SimpleNamespace
from typing import Any
from weakref import WeakSet

import genpy
from typing_extensions import override

from crazyflie_utils import text_file
from crazyflie_utils.journal.journal_file import ORIGIN, PLAIN, JournalWriter, Kind
from crazyflie_utils.steps import copy_outcome
from crazyflie_utils.timers import Executor, SteadyClock
from crazyflie_utils.topics import (
    LENGTH,
    Condition,
    ExternalPublisher,
    ExternalSubscriber,
    Receiver,
    Serve,
    Transport,
    framed,
    never,
)

_U64, _I64, _MOMENT = struct.Struct("<Q"), struct.Struct("<q"), struct.Struct("<d")
_LONGEST = 0xFFFFFFFF  #: Longest time between two inputs that is written (us).
_LOOK_PERIOD = 100_000  #: Period of looks at what is to be written, at inputs (us).
_FLAGS_PERIOD = 1_000_000  #: Longest time between two looks at all flags (us).
NO_ERRORS: Mapping[str, type[Exception]] = MappingProxyType({})
_CHECKED_TOGETHER = 64  #: Number of messages that are checked together.

# Plain numbers: those of an enumeration take longer to pack.
_TIMERS, _TIMER, _MESSAGE = map(int, (Kind.TIMERS, Kind.TIMER, Kind.MESSAGE))
_PUBLISHED, _CHECKED, _TIME, _WALL = map(int, (Kind.PUBLISHED, Kind.CHECKED, Kind.TIME, Kind.WALL))


def keeps_data(message_type: Any) -> Any:
    """Return a type of the same messages that keep the bytes from which they were read."""
    if "raw" in message_type.__slots__:
        return message_type
    if (known := _keeping.get(message_type)) is None:

        def deserialize(self: Any, data: bytes) -> Any:
            self.raw = data
            return message_type.deserialize(self, data)

        members = {"__slots__": ("raw",), "deserialize": deserialize}
        known = _keeping[message_type] = type(message_type.__name__, (message_type,), members)
    return known


_keeping: dict[type, type] = {}


def plain_type(message_type: Any) -> Any:
    """Return the type of a message as ROS generated it."""
    return message_type.__mro__[1] if "raw" in message_type.__slots__ else message_type


def serialized(message: genpy.Message) -> bytes:
    """Return a message as bytes; empty if it cannot be serialized."""
    try:
        return framed(message)[LENGTH.size :]
    except (genpy.SerializationError, struct.error, TypeError, AttributeError, ValueError):
        # Whoever sends it will say so.
        return b""


class Digest:
    """The CRC of all messages that a process has published."""

    def __init__(self) -> None:
        self.value = 0

    def add(self, message: genpy.Message, sent: bytes | None = None) -> int:
        """Add a message, without the sequence number, which rospy sets; return the last byte.

        ``sent`` is what `ExternalPublisher.publish` has returned.
        """
        begin = 4 if message._has_header else 0
        if sent is None:
            sent = getattr(message, "raw", None) or serialized(message)
        else:
            begin += LENGTH.size
        self.value = zlib.crc32(sent[begin:] if begin else sent, self.value)
        return self.value & 0xFF


class RecordedClock(SteadyClock):
    """The machine's clock, which stands still for callbacks while an input is processed."""

    def __init__(self, recorder: "Recorder", executor: Executor):
        super().__init__()
        self.now = 0  #: Moment of the present input, ns.
        self._recorder, self._executor = recorder, executor

    @override
    def time(self) -> float:
        if self._executor._runner == get_ident():
            return self.now * 1e-9
        return self._read() * 1e-9

    def _read(self):
        moment = time.monotonic_ns()
        if self._executor.is_in_turn:
            self._recorder.row(_TIME, 0, 0, _U64.pack(moment))
        return moment

    @override
    def nanoseconds(self, moment: float | None = None) -> int:
        if self._executor._runner == get_ident():
            now = self.now
        elif self._executor.is_in_turn:
            now = self._read()
        else:
            return super().nanoseconds(moment)
        offset = self._recorder.look_at_wall(is_read=True)
        return (now if moment is None else round(moment * 1e9)) + offset


class Recorder:
    """Writes the rows of one process by a `JournalWriter`; an error of it ends the journal only.

    What is called for each input or message has few calls of its own: a simulator has a thousand of
    both in a second, and a process that has slept for 10 ms runs each of them for the first time
    again, by its caches. The checks of messages, which take the longest, are calculated for many at
    a time.
    """

    def __init__(self, writer: JournalWriter):
        self._writer = writer
        self.row = writer.row
        writer.before_chunk = self._check
        self.executor: Executor
        self.clock: RecordedClock
        #: Returns wall clock minus the process's clock (ns).
        self.wall: Callable[[], int] = lambda: 0
        self.look_period = _LOOK_PERIOD  #: Time between two looks (us).
        self._next_look = self._next_flags = 0  # (us).
        self._peer_changes: Callable[[], int | None]
        self._seen_changes: int | None = None
        self.is_collecting = False  #: Whether messages are collected for the next turn.
        self.flags: dict[int, _Flag] = {}  #: Of all topics, by their numbers.
        self._last = int(writer.header["us"])
        self._wall = 0
        self._digest = Digest()
        self._unchecked: list[tuple[genpy.Message, bytes | None]] = []
        self._callers: dict[tuple[str, str], int] = {("", ""): 0}

    def attach(self, transport: Transport, executor: Executor) -> Any:
        """Begin to record; return the transport that the process is to use."""
        self.executor, self._peer_changes = executor, transport.peer_changes
        self.clock = RecordedClock(self, executor)
        self.wall = self.clock.measure_offset
        executor.before_timers = partial(self.input, _TIMERS)
        executor.before_timer = partial(self.input, _TIMER)
        _recorders.add(self)
        return RecordingTransport(transport, self)

    def input(self, kind: int, number: int = 0, data: bytes = b"") -> None:
        """Begin an input of a `Kind`, in its turn."""
        now = time.monotonic_ns() // 1000
        self.clock.now = now * 1000
        try:
            if now >= self._next_look:
                self._look(now)
            passed = now - self._last
            self._last = now
            self.row(kind, number, passed if passed < _LONGEST else _LONGEST, data)
        except Exception as error:
            self._writer.end(repr(error))

    def _look(self, now):
        """Look at what is written now and then; ``now`` is in us."""
        self._next_look = now + self.look_period
        changes = self._peer_changes()
        # Each flag is at another place of the memory, which takes longer than all else.
        if changes is None or changes != self._seen_changes or now >= self._next_flags:
            self._seen_changes, self._next_flags = changes, now + _FLAGS_PERIOD
            self._look_at_flags()
        if len(self._unchecked) >= _CHECKED_TOGETHER or not self.look_period:
            self._check()
        self._writer.pause(now * 1e-6)

    def look_at_wall(self, is_read: bool = False) -> int:
        """Return by how much the wall clock is ahead of the machine's (ns); write changes."""
        offset = self.wall()
        if offset != self._wall:
            self._wall = offset
            self.row(_WALL, is_read, 0, _I64.pack(offset))
        return offset

    def _look_at_flags(self):
        for flag in list(self.flags.values()):
            value = flag.read()
            if value is not flag.value:
                flag.value = value
                self.row(Kind.PEERS, flag.number, value)

    def _check(self):
        """Write the checks of the messages that have none yet, and look at the wall clock."""
        self.look_at_wall()
        if self._unchecked:
            add = self._digest.add
            self.row(_CHECKED, 0, 0, bytes([add(*each) for each in self._unchecked]))
            self._unchecked.clear()

    def submit_input(self, number: int, work: Callable[..., None], *arguments: Any) -> None:
        """Run a function of `NodeHandle.input`, by its number, with at most one argument."""

        def run():
            self.input(Kind.SUBMITTED, number, json.dumps(arguments).encode())
            work(*arguments)

        self.executor.post(run)

    def submit(self, node: str, callback: Callable[..., Any], work: Any, arguments: Any) -> None:
        """Run a callback that another thread has submitted for a node."""

        def run():
            inner = callback.func if isinstance(callback, partial) else callback
            known = [node, getattr(inner, "__qualname__", ""), repr(arguments)]
            self.input(Kind.SUBMITTED, 0, json.dumps(known).encode())
            work(*arguments)

        self.executor.post(run)

    def task(self, number: int) -> None:
        """Write that a task goes on, in its turn."""
        self.input(Kind.TASK, number % 0x10000)

    def post(self, kind: str, work: Callable[[], None]) -> None:
        """Do work as an input of a `Kind`, by its name."""

        def run():
            self.input(Kind[kind])
            work()

        self.executor.post(run)

    def launch(self, node: Any, name: str) -> None:
        """Write that a node is initialized in an `OfflineProcess`."""
        path = f"{type(node).__module__}:{type(node).__qualname__}"
        self.input(Kind.LAUNCH, 0, json.dumps([name, path]).encode())

    def set_clock(self, number: int, moment: float) -> None:
        """Write that a clock of a `FakeProcess` is set: its own (0) or the machine's (1); s."""
        self.input(Kind.CLOCK, number, _MOMENT.pack(moment))

    def file(self, read: Callable[[str, int], bytes], path: str, most: int) -> bytes:
        """Return what ``read`` returns for a file, and write it."""
        name = json.dumps(path).encode()
        try:
            content = read(path, most)
        except (OSError, ValueError) as error:
            text = getattr(error, "strerror", None) or str(error)
            known = [type(error).__name__, getattr(error, "errno", None), text]
            self.row(Kind.FILE, 0, 0, name + b"\n" + json.dumps(known).encode())
            raise
        self.row(Kind.FILE, 1, 0, name + b"\n" + content)
        return content

    def published(self, number: int, message: genpy.Message, sent: bytes | None) -> None:
        """Write that a callback has published a message."""
        if self.executor._runner == get_ident() or self.executor.is_in_turn:
            try:
                self.row(_PUBLISHED, number, 0)
                self._unchecked.append((message, sent))
            except Exception as error:
                self._writer.end(repr(error))

    def end_start(self) -> None:
        """Write that all nodes are initialized."""
        self._check()
        self._look_at_flags()
        self._writer.end_start()

    def close(self) -> None:
        """End the journal."""
        self._check()
        self._writer.close()

    def origin(self, header: dict[str, str] | None) -> int:
        """Return the number of a connection by its header."""
        header = header or {}
        connection = header.get("callerid", ""), header.get("topic", "")
        number = self._callers.get(connection)
        if number is None:
            # Those beyond the limit are not told apart.
            number = self._callers[connection] = min(len(self._callers), PLAIN - 1)
            self.name(Kind.CALLER, number, *connection)
        return number

    def name(self, kind: Kind, number: int, *names: str) -> None:
        """Write the name of something that has a number; of a thread's, before the next input."""

        def write():
            try:
                self.row(kind, number, 0, json.dumps(names).encode())
            except Exception as error:
                self._writer.end(repr(error))

        if self.executor.is_in_turn:
            write()
        else:
            self.executor.enqueue(write)

    def value(
        self, what: str, read: Callable[[], Any], errors: Mapping[str, type[Exception]] = NO_ERRORS
    ) -> Any:
        """Return what is read, and write it; ``errors`` are known by their names, too."""
        if not self.executor.is_in_turn:
            return read()
        try:
            value = read()
        except Exception as error:
            kind = type(error).__name__
            is_known = hasattr(builtins, kind) or kind == "ServiceError" or kind in errors
            kind = kind if is_known else "OSError"
            self.row(Kind.VALUE, 0, 0, json.dumps([what, False, kind, str(error)]).encode())
            raise
        self.row(Kind.VALUE, 0, 0, json.dumps([what, True, value], default=_plain).encode())
        return value


def _plain(value):
    return value.value if isinstance(value, Enum) else str(value)


_recorders: WeakSet[Recorder] = WeakSet()
_read_file = text_file.content


def _content(path, most):
    for recorder in _recorders:
        if recorder.executor.is_in_turn:
            return recorder.file(_read_file, path, most)
    return _read_file(path, most)


# The files of all processes with a journal that are in this process of the machine.
text_file.content = _content


class _Flag:
    """A condition that callbacks read as it was when the recorder looked; changes are written."""

    def __init__(self, executor: Executor, number: int, read: Condition):
        self.read, self.number, self.value = read, number, False
        self._executor = executor

    def __call__(self) -> bool:
        if self._executor._runner == get_ident() or self._executor.is_in_turn:
            return self.value
        return self.read()


class _RecordedSubscriber(ExternalSubscriber):
    """A subscription, whose messages are inputs."""

    def __init__(
        self,
        recorder: Recorder,
        number: int,
        plain: Any,
        deliver: Receiver,
        is_collected: bool,
    ):
        self.external: ExternalSubscriber
        self.flag: _Flag
        self._recorder, self._number = recorder, number
        self._plain_type, self._deliver = plain, deliver
        post = partial(recorder.executor.post, self._pass_on)
        #: Writes a message and passes it on, in its turn. Not a method: called for each message.
        self.receive: Receiver = self._collect if is_collected else post
        self._header: dict[str, str] | None = None
        self._origin = ORIGIN.pack(0)

    def _collect(self, message):
        """Write a message and pass it on, in its turn, or in that for which it is collected."""
        executor = self._recorder.executor
        take = executor.enqueue if self._recorder.is_collecting else executor.post
        take(self._pass_on, message)

    def _pass_on(self, message):
        header = getattr(message, "_connection_header", None)
        # Most messages come by the same connection, and share its header.
        if header is not self._header:
            self._header = header
            self._origin = ORIGIN.pack(self._recorder.origin(header))
        origin, kind = self._origin, type(message)
        try:
            data = message.raw
        except AttributeError:
            data = serialized(message)
            message = kind().deserialize(data)
            message._connection_header = header
        if kind is self._plain_type:
            origin = ORIGIN.pack(ORIGIN.unpack(origin)[0] | PLAIN)
        self._recorder.input(_MESSAGE, self._number, origin + data)
        # As a replay reads it.
        self._deliver(message)

    def has_publishers(self) -> bool:
        return self.flag()

    def close(self) -> None:
        self._recorder.flags.pop(self.flag.number, None)
        self.external.close()


class RecordingTransport:
    """Passes everything on to a `Transport`, and writes what comes back."""

    def __init__(self, transport: Transport, recorder: Recorder):
        self._transport, self._recorder = transport, recorder
        self._names: dict[str, str] = {}
        # Threads, too, take the next numbers.
        self._publishers, self._subscriptions, self._services = count(1), count(1), count(1)
        self._requests, self._flags = count(1), count(1)

    def __getattr__(self, name: str) -> Any:
        # What is only passed on, and what tests look at.
        return getattr(self._transport, name)

    def _flag(self, read: Condition) -> _Flag:
        number = next(self._flags)
        flag = self._recorder.flags[number] = _Flag(self._recorder.executor, number, read)
        return flag

    def remap(self, name: str) -> str:
        """Return a remapped name; the first time, it is written."""
        if name not in self._names:
            self._names[name] = self._transport.remap(name)
            if self._names[name] != name and self._recorder.executor.is_in_turn:
                data = json.dumps([name, self._names[name]]).encode()
                self._recorder.row(Kind.NAME, 0, 0, data)
        return self._names[name]

    def get_param(self, name: str) -> Any:
        """Return a parameter."""
        return self._recorder.value(name, lambda: self._transport.get_param(name))

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter."""
        self._recorder.value(f"set {name}", lambda: self._transport.set_param(name, value))

    def set_param_later(self, name: str, value: Any) -> "Future[None]":
        """Set a parameter; the future is done as an input."""
        inner = self._transport.set_param_later(name, value)
        return self._request(inner, name, repr(value).encode())

    def advertise(self, topic: str, message_type: Any, latch: bool) -> ExternalPublisher:
        """Announce a topic."""
        # A task may give up its turn for it: the next number is taken before.
        number = next(self._publishers)
        self._recorder.name(Kind.ADVERTISED, number, topic, message_type._type)
        external: Any = self._transport.advertise(topic, message_type, latch)
        # Called for each message: not a class around the other.
        recorded: Any = SimpleNamespace(
            note=partial(self._recorder.published, number),
            has_subscribers=self._flag(external.has_subscribers),
            publish=external.publish,
            close=external.close,
        )
        return recorded

    def subscribe(
        self, topic: str, message_type: Any, deliver: Receiver, may_wait: Condition = never
    ) -> ExternalSubscriber:
        """Subscribe to a topic; its messages come in turn."""
        number = next(self._subscriptions)
        self._recorder.name(Kind.SUBSCRIBED, number, topic, message_type._type)
        # Otherwise a message that came decoded is the same.
        plain = plain_type(message_type) if plain_type(message_type) != message_type else None
        own = _RecordedSubscriber(self._recorder, number, plain, deliver, may_wait is not never)
        keeping = keeps_data(message_type)
        # Messages may come before this returns.
        own.external = self._transport.subscribe(topic, keeping, own.receive, may_wait)
        own.flag = self._flag(own.external.has_publishers)
        return own

    def collect(self) -> None:
        """Deliver the messages that wait, for a turn that follows."""
        self._recorder.is_collecting = True
        try:
            self._transport.collect()
        finally:
            self._recorder.is_collecting = False

    def advertise_service(self, name: str, service_type: Any, serve: Serve) -> Callable[[], None]:
        """Offer a service; its calls come in turn."""
        number, recorder = next(self._services), self._recorder
        recorder.name(Kind.OFFERED, number, name, service_type._type)

        def begin(request: Any, is_withdrawn: Condition) -> Future[Any]:
            # In its turn it is too late for that.
            if not recorder.executor.is_in_turn:
                self.collect()
            answer: Future[Any] = Future()

            def run():
                data = serialized(request)
                recorder.input(Kind.CALL, number, data)
                given = service_type._request_class().deserialize(data)
                inner = serve(given, lambda: recorder.value("withdrawn", is_withdrawn))
                inner.add_done_callback(lambda done: copy_outcome(done, answer))

            recorder.executor.post(run)
            return answer

        def offer():
            ends.append(self._transport.advertise_service(name, service_type, begin))

        ends: list[Callable[[], None]] = []
        recorder.value("offer", offer)
        return ends[0]

    def call_service(
        self, name: str, service_type: type, request: Any, limit: float, start_limit: float
    ) -> Future[Any]:
        """Call a service; its answer comes in turn."""
        inner = self._transport.call_service(name, service_type, request, limit, start_limit)
        return self._request(inner, name, serialized(request), service_type)

    def _request(self, inner, name, content, service_type=None):
        number, recorder = next(self._requests) % 0x10000, self._recorder
        outer: Future[Any] = Future()
        if recorder.executor.is_in_turn:
            recorder.row(Kind.REQUESTED, number, zlib.crc32(name.encode() + content))

        def settle():
            error = inner.exception()
            if error is not None:
                recorder.input(Kind.REPLY, number, b"\1" + str(error).encode())
                copy_outcome(inner, outer)
                return
            data = b"" if service_type is None else serialized(inner.result())
            recorder.input(Kind.REPLY, number, b"\0" + data)
            if not outer.done():
                response = service_type and service_type._response_class().deserialize(data)
                outer.set_result(response)

        inner.add_done_callback(lambda _: recorder.executor.post(settle))
        return outer

    def service_nodes(self) -> dict[str, str]:
        """Return every service and its node."""
        return self._recorder.value("services", self._transport.service_nodes)

    def living_node(self, name: str) -> str | None:
        """Return where a node runs."""
        return self._recorder.value(f"node {name}", lambda: self._transport.living_node(name))

    def random_seed(self) -> int:
        """Return a random seed."""
        return self._recorder.value("seed", self._transport.random_seed)
