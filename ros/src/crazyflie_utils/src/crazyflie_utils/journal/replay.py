"""Runs the nodes of a journal again, with the same input, without ROS."""

import builtins
import collections
import json
import struct
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from queue import SimpleQueue
from typing import Any

from typing_extensions import override

from crazyflie_utils import text_file
from crazyflie_utils.context import Flights
from crazyflie_utils.handle import NodeHandle
from crazyflie_utils.journal.journal_file import (
    INPUTS,
    Journal,
    JournalError,
    Kind,
    Row,
    SourcesError,
)
from crazyflie_utils.journal.recording import NO_ERRORS
from crazyflie_utils.journal.replay_transport import (
    DifferenceError,
    EndError,
    ReplayTransport,
    Rows,
)
from crazyflie_utils.node import Node, Process, initialization_failure
from crazyflie_utils.offline_process import OfflineProcess
from crazyflie_utils.program import load_recorded
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.tasks import Tasks
from crazyflie_utils.timers import Executor, SteadyClock

_U64, _MOMENT = struct.Struct("<Q"), struct.Struct("<d")


class _ReplayExecutor(Executor):
    """Runs the timers that are due when the journal says so."""

    def __init__(self) -> None:
        super().__init__()
        self._due: collections.deque[Iterable[Callable[[], None]]] = collections.deque()
        self._timers: Iterator[Callable[[], None]] = iter(())
        self.timer = ""  #: Name of the callback of the timer that runs, or did last.

    @override
    def submit_all(self, works: Iterable[Callable[[], None]]) -> None:
        if self.is_in_turn:
            super().submit_all(works)
        else:
            self._due.append(works)

    def begin_timers(self) -> None:
        """Find out which timers are due, and run the first one."""

        def run():
            # In its turn, since that reads the clock.
            self._timers = iter(list(self._due.popleft()) if self._due else [])
            first = next(self._timers, None)
            if first is None:
                self.timer = ""
            else:
                self._fire(first)

        self.submit(run)

    def run_timer(self) -> None:
        """Run the next timer that was due."""

        def run():
            timer = next(self._timers, None)
            if timer is None:
                raise DifferenceError("then a timer was due that is not due now")
            self._fire(timer)

        self.submit(run)

    def _fire(self, work):
        self.timer = getattr(getattr(work, "__self__", None), "name", "")
        work()


class _ReplayTasks(Tasks):
    """Tasks that go on when the journal says so; what they wait for is in it."""

    def __init__(self, executor: Executor):
        super().__init__(executor)
        self._batons: dict[int, SimpleQueue[bool]] = {}
        self._back: SimpleQueue[BaseException | None] = SimpleQueue()

    @override
    def start(self, name: str, work: Callable[[], None]) -> None:
        number = next(self._numbers) % 0x10000
        self._batons[number] = SimpleQueue()
        threading.Thread(target=self._run, args=(number, work), name=name, daemon=True).start()

    @override
    def outside(self, call: Any, *arguments: Any) -> Any:
        number = getattr(self._own, "number", None)
        if number is not None:
            self._back.put(None)
            self._take_turn(number)

    def go_on(self, number: int) -> None:
        """Let a task go on until it waits again, or ends; raise what ends the replay."""
        baton = self._batons.get(number)
        if baton is None:
            raise DifferenceError(f"then task {number} went on, which does not wait now")
        runner = self._executor._runner
        baton.put(True)
        error = self._back.get()
        self._executor._runner = runner
        if error is not None:
            raise error

    def end(self) -> None:
        """End the threads of all that wait."""
        for baton in list(self._batons.values()):
            baton.put(False)

    @override
    def _run(self, number, work):
        try:
            self._take_turn(number)
            work()
        # Those that are not of nodes.
        except BaseException as error:
            outcome: BaseException | None = error
        else:
            outcome = None
        if self._batons.pop(number, None) is not None:
            self._back.put(outcome)

    @override
    def _take_turn(self, number):
        if not self._batons[number].get():
            del self._batons[number]
            raise EndError
        self._own.number, self._executor._runner = number, threading.get_ident()
        self.on_turn(number)


class _ReplayClock(SteadyClock):
    """The machine's clock of then."""

    def __init__(self, rows: Rows, executor: Executor):
        super().__init__()
        self.now = 0  #: Moment of the present input (ns).
        self.rows, self._executor = rows, executor

    def _read(self):
        if not self._executor.is_running_here:
            row = self.rows.expect(Kind.TIME, 0, "reads the clock")
            (self.now,) = _U64.unpack(row.data)
        return self.now

    @override
    def time(self) -> float:
        return self._read() * 1e-9

    @override
    def nanoseconds(self, moment: float | None = None) -> int:
        now, row = self._read(), self.rows.next
        if row is not None and row.kind is Kind.WALL and row.number == 1:
            self.rows.take()
        return (now if moment is None else round(moment * 1e9)) + self.rows.wall_offset


class _ReplayProcess(Process):
    """What comes from outside is in the journal."""

    is_replay = True
    transport: ReplayTransport
    tasks: _ReplayTasks

    @override
    def _make_tasks(self):
        return _ReplayTasks(self.executor)

    @override
    def value(
        self,
        what: str,
        read: Callable[[], Any],
        waits: bool = False,
        errors: Mapping[str, type[Exception]] = NO_ERRORS,
    ) -> Any:
        if waits:
            self.tasks.outside(read)
        return self.transport.value(what, f"reads {what}", errors)


class _RosProcess(_ReplayProcess):
    """A process that was one with ROS."""

    def __init__(self, transport: ReplayTransport, clock: str, executor: Executor, rows: Rows):
        self.machine = _ReplayClock(rows, executor)
        is_simulated = clock == "simulated"
        super().__init__(transport, is_simulated, executor=executor, machine_clock=self.machine)

    @override
    def machine_time(self) -> float:
        return self.machine.now * 1e-9

    def move_to(self, moment: int) -> None:
        """Set the machine's clock (ns)."""
        self.machine.now = moment

    def ros_time(self) -> int:
        """Return the ROS time of the present input (ns)."""
        if self.clock is self.machine:
            return self.machine.now + self.machine.rows.wall_offset
        return self.clock.nanoseconds()

    def set_wall(self, offset: int) -> None:
        """Do nothing: the clock reads the rows."""

    def find_due(self) -> None:
        """Find the timers that are due now by the machine's clock."""
        self._steady.run_due(times=10)


class _OfflineProcess(_ReplayProcess, OfflineProcess):
    """A process that was one without ROS, too."""

    def __init__(self, transport: ReplayTransport, start: float, executor: Executor):
        super().__init__(transport, start, executor=executor)
        # Nothing waited for a master.
        transport.outside = lambda call, *arguments: None

    def move_to(self, moment: int) -> None:
        """Do nothing: both clocks have rows of their own."""

    def ros_time(self) -> int:
        """Return the ROS time of the present input (ns)."""
        return self.clock.nanoseconds()

    def set_wall(self, offset: int) -> None:
        """Set the wall clock minus the process's (ns)."""
        self.clock.wall_offset = offset * 1e-9

    def find_due(self) -> None:
        """Do nothing: they are found when a clock is set."""


class Replay:
    """Runs the nodes of a journal again: `start`, then `step` until it returns False.

    Within its with block, files are read from the journal. These methods raise `DifferenceError`
    when the nodes do something else than then, `EndError` when the
    journal ends within a callback, and `JournalError` when they cannot be run.
    """

    def __init__(self, journal: Journal):
        self.journal = journal
        self.rows = Rows(journal)
        self.transport = ReplayTransport(self.rows)
        self.nodes: dict[str, Node] = {}
        self.input: Row | None = None  #: The input that is processed, or was last.
        self._executor = _ReplayExecutor()
        header = journal.header
        self.process: _RosProcess | _OfflineProcess
        if header["clock"] == "manual":
            self.process = _OfflineProcess(self.transport, header["start"], self._executor)
        else:
            self.process = _RosProcess(self.transport, header["clock"], self._executor, self.rows)

    def __enter__(self) -> "Replay":
        self._read, text_file.content = text_file.content, self._file
        return self

    def __exit__(self, *exception: object) -> None:
        text_file.content = self._read
        self.process.tasks.end()

    @property
    def ros_time(self) -> int:
        """ROS time of the present input (ns)."""
        return self.process.ros_time()

    @property
    def wall_time(self) -> int:
        """Wall time of the present input (ns)."""
        return self.rows.us * 1000 + self.rows.wall_offset

    @property
    def input_name(self) -> str:
        """What the present input is, for people."""
        row = self.input
        if row is None:
            return "the start"
        if row.kind is Kind.MESSAGE:
            return f"a message on {self.transport.subscribers[row.number].topic}"
        if row.kind is Kind.CALL:
            return f"a call of {self.transport.services[row.number][0]}"
        if row.kind in (Kind.TIMERS, Kind.TIMER):
            return f"the timer of {self._executor.timer}" if self._executor.timer else "a timer"
        return {
            Kind.REPLY: "the answer of a service",
            Kind.SUBMITTED: "a call by a thread",
            Kind.CLOCK: "the clock",
            Kind.TASK: "a task",
        }.get(row.kind, row.kind.name.lower().replace("_", " "))

    def start(self) -> bool:
        """Make and initialize the nodes; return whether that succeeded."""
        header = self.journal.header
        if isinstance(self.process, _OfflineProcess):
            return True
        handle = self.process.handle(header["node"])
        make = self._load(header["program"])
        try:
            self.nodes = {handle.name: make()} if isinstance(make, type) else make(handle)
            for name, node in self.nodes.items():
                if node.sources:
                    raise SourcesError(
                        f"{self.journal.path}: {name} reads {node.sources}: its journal can be "
                        "read, but not run again"
                    )
                if not node.initialize(self.process.handle(name)):
                    return False
        except JournalError:
            raise
        except Exception as error:
            # As the main program.
            handle.error(initialization_failure(error))
            return False
        if needed := [name for name, node in self.nodes.items() if node.needed_in_flight]:
            Flights(self.process.topics, needed)
        self._executor.start()
        return True

    def step(self) -> bool:
        """Process the next input; return whether there was one."""
        row = self.rows.next
        if row is None:
            return False
        if row.kind is Kind.WALL:
            self.rows.take()
            self.process.set_wall(self.rows.wall_offset)
            return True
        if row.kind is Kind.PEERS and row.number in self.transport.flags:
            self.transport.flags[row.number].value = bool(self.rows.take().value)
            return True
        if row.kind not in INPUTS:
            raise DifferenceError(f"now the callback has ended; then {self.rows.describe(row)}")
        self.input = self.rows.take()
        self.process.move_to(self.rows.us * 1000)
        try:
            self._handlers[row.kind](self, row)
        except JournalError:
            raise
        except Exception as error:
            # Those of nodes do not come here.
            raise JournalError(
                f"{self.journal.path}: at {self.rows.time:.3f} s, {row.kind.name} {row.number} "
                f"does not fit these nodes: {error!r}"
            ) from None
        return True

    def _load(self, path):
        """Return a class of nodes, or a function that makes nodes; run nothing else."""
        if not path:
            raise JournalError(
                f"{self.journal.path}: the nodes of {self.journal.header['node']} were made by a "
                "function without a name; they cannot be made again"
            )
        shown = f"{path:.200}"
        try:
            make = load_recorded(path)
        except (ImportError, AttributeError, ValueError) as error:
            raise JournalError(
                f"{self.journal.path}: there is no {shown} any more: {error!s:.400}"
            ) from None
        hints = getattr(make, "__annotations__", {})
        if (isinstance(make, type) and issubclass(make, Node)) or NodeHandle in hints.values():
            return make
        raise JournalError(
            f"{self.journal.path}: {shown} is not a node; expected a class derived from Node, or a "
            "function of a NodeHandle"
        )

    def _file(self, path, most):
        row = self.rows.next
        row = self.rows.expect(Kind.FILE, row.number if row else 0, f"reads the file {path}")
        name, _, content = row.data.partition(b"\n")
        if json.loads(name) != path:
            raise DifferenceError(f"now it reads the file {path}; then {name.decode()}")
        if row.number:
            return content
        kind, number, text = json.loads(content)
        error = getattr(builtins, kind, OSError)
        raise error(number, text) if number is not None else error(text)

    def _message(self, row):
        own = self.transport.subscribers[row.number]
        self._executor.submit(own.deliver, own.message(row))

    def _timers(self, _):
        self.process.find_due()
        self._executor.begin_timers()

    def _timer(self, _):
        self._executor.run_timer()

    def _call(self, row):
        name, service_type, serve = self.transport.services[row.number]
        request = service_type._request_class().deserialize(row.data)

        def is_withdrawn():
            return self.transport.value("withdrawn", f"looks whether a call of {name} is withdrawn")

        def run():
            serve(request, is_withdrawn)

        self._executor.submit(run)

    def _reply(self, row):
        service_type, future = self.transport.requests.pop(row.number)
        if row.data[0]:
            self._executor.submit(future.set_exception, ServiceError(row.data[1:].decode()))
        else:
            response: Any = None
            if service_type is not None:
                response = service_type._response_class().deserialize(row.data[1:])
            self._executor.submit(future.set_result, response)

    def _submitted(self, row):
        known = json.loads(row.data)
        if row.number:
            work, decode = self.process.inputs[row.number - 1]
            self._executor.submit(work, *map(decode, known))
        else:
            node, function, arguments = known
            raise JournalError(
                f"{self.journal.path}: at {self.rows.time:.3f} s, a thread of {node} has called "
                f"{function}{arguments}, which cannot be repeated"
            )

    def _task(self, row):
        self._executor.submit(self.process.tasks.go_on, row.number)

    def _prepare_shutdown(self, _):
        self.process.prepare_shutdown(self.nodes)

    def _shutdown(self, _):
        self.process.begin_shutdown(self.nodes)

    def _clock(self, row):
        offline = self._expect_offline()
        set_clock = (offline.set_clock, offline.set_machine_clock)[row.number]
        set_clock(*_MOMENT.unpack(row.data))

    def _launch(self, row):
        name, path = json.loads(row.data)
        try:
            self.nodes[name] = self._load(path)()
        except TypeError as error:
            raise JournalError(f"{self.journal.path}: {name} cannot be made: {error}") from None
        self._expect_offline().initialize(self.nodes[name], name)

    def _expect_offline(self):
        if isinstance(self.process, _OfflineProcess):
            return self.process
        raise ValueError("only a process without ROS has it")

    _handlers = {
        Kind.MESSAGE: _message,
        Kind.TIMERS: _timers,
        Kind.TIMER: _timer,
        Kind.CALL: _call,
        Kind.REPLY: _reply,
        Kind.SUBMITTED: _submitted,
        Kind.PREPARE_SHUTDOWN: _prepare_shutdown,
        Kind.SHUTDOWN: _shutdown,
        Kind.CLOCK: _clock,
        Kind.LAUNCH: _launch,
        Kind.TASK: _task,
    }
