"""What a process that is run again reads and sends: it comes from a journal, and is compared."""

import builtins
import collections
import json
import math
import struct
import zlib
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

import genpy

from crazyflie_utils.journal.journal_file import (
    INPUTS,
    NAMES,
    UNCHECKED,
    Journal,
    JournalError,
    Kind,
    Row,
    received,
)
from crazyflie_utils.journal.recording import (
    NO_ERRORS,
    Digest,
    keeps_data,
    plain_type,
    serialized,
)
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.topics import (
    Condition,
    ExternalPublisher,
    ExternalSubscriber,
    Receiver,
    Serve,
    Transport,
    framed,
    never,
)

_I64, _MOMENT = struct.Struct("<q"), struct.Struct("<d")


class DifferenceError(BaseException):
    """The process did something else than what was recorded; the text says what.

    Not an `Exception`: callbacks of nodes are guarded against those. ``published`` is the topic and
    the message, if it is its values that are others.
    """

    def __init__(self, text: str, published: tuple[str, genpy.Message] | None = None):
        super().__init__(text)
        self.published = published


class EndError(BaseException):
    """The journal has ended while a callback was running."""


class Rows:
    """The rows of a journal, one after the other, and the time of the last one."""

    def __init__(self, journal: Journal):
        self._path, self._rows = journal.path, journal.rows()
        self._header = journal.header
        self.us: int = journal.header["us"]  #: The machine's clock, us.
        self.wall_offset = 0  #: Wall clock minus the process's own, ns.
        self.moment: float = journal.header["start"]  #: A clock that is set by hand, s.
        self.inputs = 0  #: Number of inputs that were taken.
        #: Numbers to names, by kind of `NAMES`.
        self.names: dict[Kind, dict[int, list[str]]] = {kind: {} for kind in NAMES}
        self._headers: dict[int, dict[str, str]] = {}
        self.next: Row | None = None  #: The next row; None at the end.
        self.counts: collections.Counter[Kind] = collections.Counter()
        self._advance()

    def _advance(self):
        row = next(self._rows, None)
        while row is not None and row.kind in NAMES:
            try:
                names = json.loads(row.data)
            except (ValueError, RecursionError):
                names = None
            if not (isinstance(names, list) and list(map(type, names)) == [str, str]):
                raise JournalError(f"{self._path}: a {row.kind.name} is not two names in JSON")
            self.names[row.kind][row.number] = names
            row = next(self._rows, None)
        self.next = row

    def take(self) -> Row:
        """Return the next row, and go on to the one behind it; `EndError` at the end."""
        row = self.next
        if row is None:
            raise EndError
        self.counts[row.kind] += 1
        if row.kind in INPUTS:
            self.us += row.value
            self.inputs += 1
        if row.kind is Kind.WALL:
            (self.wall_offset,) = _I64.unpack(row.data)
        elif row.kind is Kind.CLOCK and row.number == 0:
            (self.moment,) = _MOMENT.unpack(row.data)
        self._advance()
        return row

    @property
    def time(self) -> float:
        """Time since the start (s), by the machine's clock, or by the one that is set by hand."""
        if self._header["clock"] == "manual":
            return self.moment - float(self._header["start"])
        return float(self.us - self._header["us"]) * 1e-6

    @property
    def next_time(self) -> float:
        """`time` of the next input (s); infinity if there is none, or something else is next."""
        row = self.next
        if row is None or row.kind not in INPUTS:
            return math.inf
        if self._header["clock"] != "manual":
            return self.time + row.value * 1e-6
        if row.kind is Kind.CLOCK and row.number == 0 and len(row.data) == _MOMENT.size:
            return float(_MOMENT.unpack(row.data)[0]) - float(self._header["start"])
        return self.time

    def connection(self, number: int) -> dict[str, str] | None:
        """Return the header that all messages of a connection share, or None."""
        if number not in self._headers and number in self.names[Kind.CALLER]:
            names = self.names[Kind.CALLER][number]
            self._headers[number] = dict(zip(("callerid", "topic"), names, strict=True))
        return self._headers.get(number)

    def check_name(self, kind: Kind, number: int, *names: str) -> None:
        """Raise `DifferenceError` if something with a number had other names."""
        then = self.names[kind].get(number, "nothing more")
        if then != list(names):
            if self.next is None:
                raise EndError
            raise DifferenceError(f"{kind.name.lower()} now: {names}; then: {then}")

    def expect(self, kind: Kind, number: int, doing: str) -> Row:
        """Return the next row, which must be of a kind and number; `DifferenceError` if it is not.

        ``doing`` says what the process does.
        """
        row = self.next
        if row is not None and (row.kind is not kind or row.number != number):
            raise DifferenceError(f"now it {doing}; then {self.describe(row)}")
        return self.take()

    def describe(self, row: Row) -> str:
        """Return what the process did when a row was written."""
        if row.kind in INPUTS:
            return "the callback ended there"
        number, text = row.number, row.data[:200].decode(errors="replace")
        topic = "a topic that is not advertised now"
        if row.kind is Kind.PUBLISHED:
            topic = self.names[Kind.ADVERTISED].get(number, [topic])[0]
        texts = {
            Kind.PUBLISHED: f"it published on {topic}",
            Kind.REQUESTED: "it called a service or set a parameter",
            Kind.VALUE: f"it read the value {text}",
            Kind.FILE: f"it read the file {text.partition(chr(10))[0]}",
            Kind.NAME: f"it looked for the remapped name {text}",
            Kind.TIME: "it read the clock",
        }
        return texts.get(row.kind, f"there was a {row.kind.name} {number}")


class _Flag:
    value = False

    def __call__(self) -> bool:
        return self.value


class _Publisher(ExternalPublisher):
    def __init__(self, transport: "ReplayTransport", number: int, topic: str, flag: _Flag):
        self._transport, self._number, self._topic = transport, number, topic
        self._flag = flag

    def note(self, message: genpy.Message, sent: bytes | None) -> None:
        transport = self._transport
        transport.on_publish(self._topic, message)
        rows, doing = transport.rows, f"publishes on {self._topic}"
        row = rows.expect(Kind.PUBLISHED, self._number, doing)
        if row.value not in (transport.digest.add(message, sent), UNCHECKED):
            text = f"other values are published on {self._topic}"
            raise DifferenceError(text, (self._topic, message))

    def has_subscribers(self) -> bool:
        return self._flag()

    def publish(self, *messages: genpy.Message) -> bytes | None:
        # Those that cannot be serialized fail as they did then.
        return [framed(message) for message in messages][-1]

    def close(self) -> None:
        self._transport.outside(None)


class _Subscriber(ExternalSubscriber):
    def __init__(self, rows: Rows, topic: str, types: tuple[Any, Any], flag: _Flag):
        self.topic = topic
        self.deliver: Receiver
        self._rows, self._types, self._flag = rows, types, flag

    def message(self, row: Row) -> Any:
        """Return the message that a row has."""
        connection, is_plain, data = received(row)
        plain, keeping = self._types
        message = (plain if is_plain else keeping)().deserialize(data)
        message._connection_header = self._rows.connection(connection)
        return message

    def has_publishers(self) -> bool:
        return self._flag()

    def close(self) -> None:
        pass


class ReplayTransport(Transport):
    """Answers as the transport did that was recorded."""

    def __init__(self, rows: Rows):
        self.rows, self.digest = rows, Digest()
        #: Called with the topic and each message that is published, before it is compared.
        self.on_publish: Callable[[str, genpy.Message], None] = lambda topic, message: None
        self.on_log: Callable[[str, str], None] = lambda level, text: None
        #: subscribers, services: By their numbers in the journal.
        self.subscribers: dict[int, _Subscriber] = {}
        self.services: dict[int, tuple[str, Any, Serve]] = {}
        self.flags: dict[int, _Flag] = {}  #: Whether topics have subscribers, or publishers.
        #: requests: Number to type, or None, and future of the answer.
        self.requests: dict[int, tuple[Any, Future[Any]]] = {}
        self._names: dict[str, str] = {}
        self._publishers = self._requests = 0

    def _flag(self):
        number = len(self.flags) + 1
        self.flags[number] = _Flag()
        return self.flags[number]

    def value(
        self, what: str, doing: str, errors: Mapping[str, type[Exception]] = NO_ERRORS
    ) -> Any:
        """Return what was read then, or raise it; ``doing`` is what the process does now."""
        row = self.rows.expect(Kind.VALUE, 0, doing)
        then, is_value, *rest = json.loads(row.data)
        if then != what:
            raise DifferenceError(f"now it {doing}; then it read {then}")
        if is_value:
            return rest[0]
        kind, text = rest
        error: Any = {"ServiceError": ServiceError, **errors}.get(kind)
        raise (error or getattr(builtins, kind, OSError))(text)

    def remap(self, name: str) -> str:
        """Return a remapped name."""
        if name not in self._names:
            self._names[name], row = name, self.rows.next
            if row is not None and row.kind is Kind.NAME:
                first, mapped = json.loads(row.data)
                if first == name:
                    self._names[name] = mapped
                    self.rows.take()
        return self._names[name]

    def get_param(self, name: str) -> Any:
        """Return a parameter."""
        self.outside(None)
        return self.value(name, f"reads the parameter {name}")

    def set_param(self, name: str, value: Any) -> None:
        """Do nothing, or fail as then."""
        self.outside(None)
        self.value(f"set {name}", f"sets the parameter {name}")

    def set_param_later(self, name: str, value: Any) -> "Future[None]":
        """Return a future of the recorded end."""
        return self._request(None, name, repr(value).encode())

    def advertise(self, topic: str, message_type: Any, latch: bool) -> ExternalPublisher:
        """Return a publisher whose messages are compared."""
        self._publishers += 1
        number = self._publishers
        self.rows.check_name(Kind.ADVERTISED, number, topic, message_type._type)
        self.outside(None)
        return _Publisher(self, number, topic, self._flag())

    def subscribe(
        self, topic: str, message_type: Any, deliver: Receiver, may_wait: Condition = never
    ) -> ExternalSubscriber:
        """Return a subscription whose messages are in the journal."""
        number = len(self.subscribers) + 1
        self.rows.check_name(Kind.SUBSCRIBED, number, topic, message_type._type)
        types = plain_type(message_type), keeps_data(message_type)
        own = self.subscribers[number] = _Subscriber(self.rows, topic, types, self._flag())
        own.deliver = deliver
        return own

    def advertise_service(self, name: str, service_type: Any, serve: Serve) -> Callable[[], None]:
        """Keep a service for the calls in the journal."""
        number = len(self.services) + 1
        self.rows.check_name(Kind.OFFERED, number, name, service_type._type)
        self.services[number] = name, service_type, serve
        self.outside(None)
        self.value("offer", f"offers the service {name}")
        return lambda: self.outside(None)

    def call_service(
        self, name: str, service_type: type, request: Any, limit: float, start_limit: float
    ) -> Future[Any]:
        """Return a future of the recorded answer."""
        return self._request(service_type, name, serialized(request))

    def _request(self, service_type, name, content):
        self._requests += 1
        number = self._requests % 0x10000
        row = self.rows.expect(Kind.REQUESTED, number, f"calls or sets {name}")
        if row.value != zlib.crc32(name.encode() + content):
            raise DifferenceError(f"now it calls or sets {name} with something else")
        future: Future[Any] = Future()
        self.requests[number] = service_type, future
        return future

    def service_nodes(self) -> dict[str, str]:
        """Return the services of then."""
        self.outside(None)
        return self.value("services", "looks for services")

    def living_node(self, name: str) -> str | None:
        """Return the process of then."""
        self.outside(None)
        return self.value(f"node {name}", f"looks for the node {name}")

    def random_seed(self) -> int:
        """Return the seed of then."""
        return self.value("seed", "draws a random seed")

    def log(self, level: str, text: str) -> None:
        """Pass a text on."""
        self.on_log(level, text)
