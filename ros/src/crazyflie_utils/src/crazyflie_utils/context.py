"""The objects that the nodes of one process share, their logs, and the flights it waits for."""

import math
import time
import traceback
from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from crazyflie_utils.tasks import Tasks
from crazyflie_utils.tf.transforms import (
    MAX_CLOCK_DELAY_SIMULATED,
    MAX_FUTURE_STAMP,
    MAX_FUTURE_STAMP_SIMULATED,
    Transforms,
)
from crazyflie_utils.timers import (
    Executor,
    SimulatedClock,
    SimulatedTimers,
    SteadyClock,
    TimerQueue,
)
from crazyflie_utils.topics import Publisher, Topics, Transport

FLIGHTS_TOPIC = "/flights"  #: Topic of nodes that start and end flights, latched.

_IN_FLIGHT, _TO_END, _ON_GROUND = "in flight", "in flight, to end", "on ground"
#: Largest time by which a step of simulated time makes timers late, and number of larger ones in a
#: row that are reported (s).
_LATE, _LATE_STEPS = 0.03, 10
_LAND = "is to end: land"  # Of a node without which other nodes' flights end.


class OwnFlights:
    """The flights that nodes of this process start and end, which inhibit the end of processes.

    All are in one message, a line each: a process that starts later is sent only the last message.
    So are requests to land, which a node sends that is to end, and without which flights end.
    """

    def __init__(self, topics: Topics):
        self._topics = topics
        self._publisher: Publisher | None = None
        self._states: dict[str, str] = {}
        self._landings: dict[str, Callable[[str], None]] = {}

    @property
    def in_flight(self) -> list[str]:
        """Names of the nodes of this process that are in flight."""
        return [node for node, state in self._states.items() if state != _ON_GROUND]

    def inhibit_shutdown(self, node: str, land: Callable[[str], None]) -> Callable[[bool], None]:
        """Return ``publish(in_flight)`` for a node, named absolutely.

        ``land(name)`` is called when another node, which its flight needs, is to end.
        """
        self._advertise()
        if not self._landings:
            self._topics.subscribe(FLIGHTS_TOPIC, String, self._on_flights)
        self._landings[node] = land
        return lambda in_flight: self._publish({node: _IN_FLIGHT if in_flight else _ON_GROUND})

    def advertise_landing_request(self, node: str) -> Callable[[], None]:
        """Return ``request()``, which asks to end the flights that need a node."""
        publisher = self._advertise()
        return lambda: publisher.publish(String("\n".join([*self._lines(), f"{node} {_LAND}"])))

    def publish_ending(self) -> None:
        """Publish that the flights, if any, are ending because their process is to end."""
        self._publish(dict.fromkeys(self.in_flight, _TO_END))

    def _publish(self, states):
        if self._publisher is not None and not states.items() <= self._states.items():
            self._states |= states
            self._publisher.publish(String("\n".join(self._lines())))

    def _lines(self):
        return [f"{node} {state}" for node, state in self._states.items()]

    def _advertise(self):
        if self._publisher is None:
            self._publisher = self._topics.publisher(FLIGHTS_TOPIC, String, latch=True)
        return self._publisher

    def _on_flights(self, message):
        for asking, state in _parsed(message):
            if state == _LAND:
                for node, land in list(self._landings.items()):
                    if node in self.in_flight and are_related(asking, node):
                        land(asking)


class Flights:
    """The flights that concern nodes, by absolute name: in their namespaces, above and below."""

    def __init__(self, topics: Topics, nodes: Iterable[str]):
        self._nodes = list(nodes)
        self._in_flight: dict[str, bool] = {}
        self._to_end_since: dict[str, float] = {}
        topics.subscribe(FLIGHTS_TOPIC, String, self._note)

    @property
    def in_flight(self) -> list[str]:
        """Names of the nodes whose flights have not ended."""
        return sorted(name for name, flies in self._in_flight.items() if flies)

    def unattended(self, within: float) -> list[str]:
        """Return those in flight that were not published as ending within ``within`` (s)."""
        since = time.monotonic() - within
        return [name for name in self.in_flight if self._to_end_since.get(name, since) <= since]

    def _note(self, message: String) -> None:
        for name, state in _parsed(message):
            if state != _LAND and any(are_related(name, node) for node in self._nodes):
                self._in_flight[name] = state in (_IN_FLIGHT, _TO_END)
                if state == _TO_END:
                    self._to_end_since[name] = time.monotonic()


def _parsed(message):
    return [line.partition(" ")[::2] for line in message.data.splitlines()]


def are_related(one: str, other: str) -> bool:
    """Return whether the namespace of one absolute name is, or is in, that of the other."""
    here, there = (name.rpartition("/")[0] + "/" for name in (one, other))
    return here.startswith(there) or there.startswith(here)


_MAX_KEYS = 64


class Throttle:
    """Passes each key once in a period; new keys do not pass while `_MAX_KEYS` are stored."""

    def __init__(self) -> None:
        self._allowed_from: dict[Hashable, float] = {}

    def passes(self, key: Hashable, period: float, now: float) -> bool:
        """Return whether ``key`` may pass at ``now`` (s); if so, not again for ``period`` (s)."""
        if now < self._allowed_from.get(key, now):
            return False
        if key not in self._allowed_from and len(self._allowed_from) >= _MAX_KEYS:
            self._allowed_from = {k: end for k, end in self._allowed_from.items() if now < end}
            if len(self._allowed_from) >= _MAX_KEYS:
                return False
        self._allowed_from[key] = now + period
        return True


class NodeLog:
    """Log of one node, whose absolute name begins each text; ``time`` is the machine's clock, s."""

    def __init__(self, transport: Transport, node: str, time: Callable[[], float]):
        self._transport = transport
        self._node, self._time = node, time
        self._throttle = Throttle()

    def info(self, text: str) -> None:
        """Log information for an operator."""
        self._transport.log("info", f"{self._node}: {text}")

    def warn(self, text: str, throttle: float = 0.0, key: Hashable = None) -> None:
        """Log a warning; the same ``key`` (the text) at most once in ``throttle`` seconds.

        The time is that of the machine's clock, also in simulated time. A varying text needs a key.
        """
        key = text if key is None else key
        if throttle <= 0.0 or self._throttle.passes(key, throttle, self._time()):
            self._transport.log("warn", f"{self._node}: {text}")

    def error(self, text: str) -> None:
        """Log an error that makes the node fail."""
        self._transport.log("error", f"{self._node}: {text}")


class FaultHandler:
    """Logs exceptions of a node's callbacks, and calls its `enter_safe_state`.

    A new fault is logged with its traceback; repetitions are only counted.
    """

    def __init__(self, log: NodeLog):
        self.enter_safe_state: Callable[[], None] | None = None  #: Called after each fault.
        self._log = log
        self._counts: dict[tuple[type, str, int | None], int] = {}

    def report(self, callback: Callable[..., Any], error: Exception) -> None:
        """Log that ``callback`` has raised ``error``, and put the node into its safe state."""
        where = traceback.extract_tb(error.__traceback__)[-1]
        fault = (type(error), where.filename, where.lineno)
        count = self._counts[fault] = self._counts.get(fault, 0) + 1
        name = getattr(callback, "__qualname__", repr(callback))
        if count == 1:
            self._log.error(f"{name} failed\n{''.join(traceback.format_exception(error))}")
        else:
            self._log.warn(
                f"{name} failed again: {error!r} ({count} times)", throttle=5.0, key=fault
            )
        if self.enter_safe_state is None:
            return
        try:
            self.enter_safe_state()
        except Exception as second:
            self._log.error(f"enter_safe_state failed too: {second!r}")


class ProcessContext:
    """One executor, one clock, one set of topics and one tf buffer for all nodes of a process.

    With ``use_sim_time`` the clock is simulated time, which stands still until it is set; a process
    without ROS passes its own clocks and ``executor``. A ``recorder`` writes the journal.
    """

    def __init__(
        self,
        transport: Transport,
        use_sim_time: bool,
        clock: SimulatedClock | SteadyClock | None = None,
        recorder: Any = None,
        executor: Executor | None = None,
        machine_clock: SimulatedClock | SteadyClock | None = None,
    ):
        self.executor, given = executor or Executor(), transport
        transport.is_in_callback = lambda: self.executor.is_running_here
        self.tasks = self._make_tasks()
        self.recorder = recorder  #: A `Recorder`, whose module is loaded only if there is one.
        if recorder is not None:
            transport = recorder.attach(transport, self.executor)
            self.tasks.on_turn = recorder.task
            machine_clock = machine_clock or recorder.clock
        machine_clock = machine_clock or SteadyClock()
        self.transport = transport
        self.topics = Topics(transport)
        self.clock: SimulatedClock | SteadyClock = clock or (
            SimulatedClock() if use_sim_time else machine_clock
        )
        given.time = transport.time = self.clock.time
        given.outside = self.tasks.outside
        tf_log = NodeLog(transport, "/tf", self.machine_time)
        self.transforms = Transforms(
            self.topics,
            lambda text, key: tf_log.warn(text, throttle=1.0, key=key),
            self.clock.nanoseconds,
            MAX_FUTURE_STAMP_SIMULATED if use_sim_time else MAX_FUTURE_STAMP,
            MAX_CLOCK_DELAY_SIMULATED if use_sim_time else 0.0,
        )
        # The poses of all vehicles that are simulated in one tick form one message.
        tf = self.transforms.before_timers, self.transforms.send_gathered
        self._steady = TimerQueue(self.executor, machine_clock, *tf, transport.collect)
        self._simulated = SimulatedTimers(self.executor, self.clock, *tf)
        self._clock_publisher: Publisher | None = None
        #: Work and decoder of each input of `NodeHandle.input`, by its number - 1.
        self.inputs: list[tuple[Callable[..., None], Callable[[Any], Any]]] = []
        #: Absolute names of the parameters that nodes of the process have declared, read or set.
        self.known_parameters: set[str] = set()
        self.flights = OwnFlights(self.topics)
        #: Exit status with which the process is to end; None while it is not to end.
        self.exit_status: int | None = None
        #: Whether the process ends as soon as its flights have ended: none may begin.
        self.is_ending = False
        self.is_refused = False  #: Whether another process flies the vehicle of this one's nodes.
        if isinstance(self.clock, SimulatedClock):
            self._clock_log = NodeLog(self.transport, "/clock", self.machine_time)
            self._late_steps = 0
            self.clock.on_change(self._run_simulated)
            # Queued with all other work: time does not move within a callback, and a reset does not
            # overtake earlier messages of the simulation.
            move = partial(self.executor.submit, self.clock.set)
            self.topics.subscribe("/clock", Clock, lambda message: move(message.clock.to_sec()))

    is_replay = False  #: Whether a journal has all that comes from outside.

    def _make_tasks(self):
        return Tasks(self.executor)

    def value(
        self,
        what: str,
        read: Callable[[], Any],
        waits: bool = False,
        errors: Mapping[str, type[Exception]] = MappingProxyType({}),
    ) -> Any:
        """Return, or raise, the outcome of ``read()``, which a replay takes from the journal.

        What was read has a name there, and must be JSON. If it ``waits``, the turn of a task is
        given up meanwhile. ``errors`` are those that it may raise beside Python's own, by name.
        """
        if waits:
            read = partial(self.tasks.outside, read)
        return read() if self.recorder is None else self.recorder.value(what, read, errors)

    def end(self, status: int) -> None:
        """Shut the process down; it exits with ``status``."""
        self.exit_status = status

    def machine_time(self) -> float:
        """Return seconds of the machine's clock, for what is not to be in a journal."""
        if self.recorder is not None and self.executor.is_running_here:
            return float(self.recorder.clock.now * 1e-9)
        return time.monotonic()

    @property
    def uses_sim_time(self) -> bool:
        """Whether the clock is simulated time (/use_sim_time)."""
        return isinstance(self.clock, SimulatedClock)

    def timers(self, steady: bool = False) -> TimerQueue:
        """Return the timers by the process's clock, or by the machine's if ``steady``."""
        return self._steady if steady or not self.uses_sim_time else self._simulated

    def clock_publisher(self) -> Callable[..., None]:
        """Return ``set_clock(moment, passed=())``, which moves simulated time to a moment (s).

        Other processes receive the moments ``passed`` meanwhile, too, all at once. In this process
        time moves after the present callback; then the due timers run.
        """
        publisher = self._clock_publisher = self.topics.publisher("/clock", Clock, latch=False)

        def set_clock(moment: float, passed: Iterable[float] = ()) -> None:
            stamp = self.clock.stamp(moment)
            self.transport.clock_was_set(stamp)
            heard = passed if publisher.is_heard_outside() else ()
            publisher.publish(_clock(stamp), [_clock(self.clock.stamp(each)) for each in heard])

        return set_clock

    def next_event(self) -> float:
        """Return the next moment, s, at which the publisher of simulated time must stop.

        That is when a timer of this process is due; or at once, if /clock has a subscriber in this
        process in addition to the process itself.
        """
        publisher = self._clock_publisher
        if publisher is None or publisher.is_read_here(excluding=1):
            return -math.inf
        return self._simulated.next_deadline()

    def _run_simulated(self, now, is_reset):
        if is_reset:
            self.transforms.clear()
            self._simulated.rebase(now)
        late = now - self._simulated.next_deadline()
        self._late_steps = self._late_steps + 1 if late > _LATE else 0
        if self._late_steps >= _LATE_STEPS:
            self._clock_log.warn(
                f"simulated time moves in steps by which timers are {late:.2f} s late; expected at "
                f"most {_LATE:g} s. Flights will be wrong: its source is to publish more often",
                throttle=10.0,
                key="steps",
            )
        self._simulated.run_due(now)


def _clock(stamp):
    # The type's own constructor takes several times as long.
    message = object.__new__(Clock)
    message.clock = stamp
    return message
