"""Main programs: one node in a process, or many; and how such a process ends."""

import contextlib
import gc
import io
import logging
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import NoReturn

import rosgraph
import rospkg
import rospy

from crazyflie_utils.context import Flights
from crazyflie_utils.handle import NodeHandle
from crazyflie_utils.node import Node, Process, initialization_failure
from crazyflie_utils.parameters.declaration import ParameterError, Parameters, parameter
from crazyflie_utils.parameters.server import leaves
from crazyflie_utils.parameters.types import BOOLEAN, TOPIC, Converted
from crazyflie_utils.program import load, missing_module
from crazyflie_utils.refusal import listed
from crazyflie_utils.ros1.master_watch import MasterWatch, bounded_master, namesake
from crazyflie_utils.ros1.transport import RosTransport

JOURNAL_SWITCH = "CRAZYFLIE_JOURNAL"  #: Environment variable; see `crazyflie_utils.journal.start`.
_END_LIMIT = 5.0  #: Longest time that the shutdown waits for nodes without a flight (s).
#: Time that a refused node of roslaunch waits before it ends (s): with respawn, it would otherwise
#: take the processor from the nodes that fly.
_REFUSED_TIME = 5.0
_MASTER_LIMIT = 10.0  #: Longest time that a node waits for a ROS master (s).
#: Time after which a master that accepts requests, and does not answer, is silent (s).
SILENCE_LIMIT = 3.0
_WATCH_PERIOD = 1.0  #: Period at which it is asked while nodes start (s).
#: Time after which a computing thread yields to a waiting one (s): 5 ms by default.
_SWITCH_INTERVAL = 0.0005


def run(node_class: type | str, default_name: str) -> None:
    """Run one node in this process until ROS shuts down; does not return.

    The class is a subclass of `Node`, or "package.module:Class"; the launch file may give another
    name. Exits with status 1 when the node cannot be initialized.
    """

    def make_node(handle):
        make = _node_class(node_class) if isinstance(node_class, str) else node_class
        return {handle.name: make()}

    _begin_and_run(default_name, make_node, node_class)


def composed_nodes(handle: NodeHandle) -> dict[str, Node]:
    """Return the nodes that the private parameter ``nodes`` lists, by absolute name.

    ``nodes`` maps a node's name, relative to this process's namespace, to its
    class as "package.module:Class". Each node has the parameters, topics and
    services it would have in a process of its own.
    """
    classes = handle.load(ComposedParameters).nodes
    return {handle.resolve(name): make() for name, make in classes.items()}


def run_nodes(default_name: str, make_nodes: Callable[[NodeHandle], dict[str, Node]] | str) -> None:
    """Run the nodes that a function makes; does not return.

    ``make_nodes(handle)``, with the handle of the process's own node, returns all nodes by absolute
    name; or it is named as "package.module:function". An exception of the function ends the process
    with status 1. The launch file may give another name than ``default_name`` to the process's own
    node.
    """
    _begin_and_run(default_name, make_nodes, make_nodes)


def _begin_and_run(default_name, make_nodes, program):
    signals = catch_signals()
    _run(begin(default_name, signals, _path(program)), make_nodes, signals)


def _path(program):
    """Return a class or function as "package.module:name"; "" if it has no such name."""
    if isinstance(program, str):
        return program
    name = getattr(program, "__qualname__", "<")
    return "" if "<" in name or program.__module__ == "__main__" else f"{program.__module__}:{name}"


def _node_classes(value):
    if not isinstance(value, dict) or not value:
        raise ValueError
    return {TOPIC(name): _node_class(path) for name, path in leaves(value)}


#: The nodes of a process: a dictionary of name to class.
NODE_CLASSES = Converted(
    _node_classes,
    'a dictionary of node name: "package.module:Class"',
    "dictionary, string to string",
)


class ComposedParameters(Parameters):
    """Parameters of a process of many nodes."""

    nodes: dict[str, type[Node]] = parameter(NODE_CLASSES, 'node name to "package.module:Class"')


def _node_class(path):
    try:
        found = load(str(path))
    except Exception as error:
        reason = missing_module(error) or repr(error)
        raise ValueError(f"no class {path!r}: {reason}") from error
    if not (isinstance(found, type) and issubclass(found, Node)):
        raise ValueError(f"{path!r} is not a subclass of Node")
    return found


def begin(default_name: str, signals: list[int] | None = None, program: str = "") -> Process:
    """Make this process a ROS node; return the `Process`, not yet started.

    With ``program``, "package.module:name" of what makes the nodes, it may have a journal. Exits
    with status 1 without a ROS master that answers, if another node of this name is alive (which
    the master would shut down), and at ``signals``, see `catch_signals`.
    """
    # rospy's log is not flushed: the last texts of a node that dies would be lost in a pipe.
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)
    _wait_for_master(signals)
    mappings = rospy.names.get_mappings()
    own_name = mappings.get("__name", default_name)
    with _watched_master():
        refusal = namesake({rosgraph.names.resolve_name(own_name, rospy.get_name())})
        if refusal:
            print(refusal, file=sys.stderr, flush=True)
            _pause_refused(signals)
            sys.exit(1)
        rospy.init_node(default_name, disable_signals=signals is not None)
        return ros_process(program)


def _pause_refused(signals):
    """Wait until a refused node may end, if roslaunch may start it again."""
    is_launched = "__log" in rospy.names.get_mappings()
    end = time.monotonic() + (_REFUSED_TIME if is_launched else 0.0)
    while not signals and time.monotonic() < end:
        time.sleep(0.05)


def begin_script(
    default_name: str, on_shutdown: Callable[[], None] = lambda: None
) -> tuple[Process, Callable[[], None]]:
    """Make a user's script, in which Python handles Ctrl-C, a ROS node, unless it is one already.

    Returns the process, not yet started, which has an exit status when ROS shuts down; and
    ``end()``, which stops it, and the ROS node if it was made here. Whoever shuts ROS down,
    ``on_shutdown()`` is called first, in that thread, while topics and services still work.
    """
    is_own = not rospy.core.is_initialized()
    if is_own:
        _wait_for_master()
    with _watched_master():
        if is_own:
            # Without a given name it has one of its own.
            if given := rospy.names.get_mappings().get("__name"):
                name = rosgraph.names.resolve_name(given, rospy.get_name())
                if refusal := namesake({name}):
                    sys.exit(refusal)
            rospy.init_node(default_name, anonymous=True, disable_signals=True)
        process = ros_process()

    def shut_down() -> None:
        process.end(0)
        on_shutdown()

    rospy.on_shutdown(shut_down)

    def end() -> None:
        process.stop()
        if is_own:
            time.sleep(FLUSH_TIME)
            rospy.signal_shutdown("the script has ended")

    return process, end


def ros_process(program: str = "") -> Process:
    """Return the `Process` of a process that is a ROS node already; see `begin`."""
    value = rospy.get_param("/use_sim_time", False)
    try:
        use_sim_time = BOOLEAN(value)
    except ValueError:
        rospy.logerr(f"parameter /use_sim_time is {value!r}; expected {BOOLEAN}")
        fail()
    # In simulated time the rate of messages is not limited.
    transport = RosTransport(limits_rate=not use_sim_time)
    if use_sim_time:
        transport.follow_clock()
    return Process(transport, use_sim_time, recorder=_recorder(program, use_sim_time))


def _recorder(program, use_sim_time):
    if not (program and os.environ.get(JOURNAL_SWITCH)):
        return None
    begin_journal = load("crazyflie_utils.journal.start:begin_journal")
    clock = "simulated" if use_sim_time else "steady"
    log = rospy.names.get_mappings().get("__log")
    folder = os.path.dirname(log) if log else rospkg.get_log_dir()
    return begin_journal(rospy.get_name(), program, clock, folder, rospy.logwarn)


def _answers(limit=SILENCE_LIMIT):
    """Return whether the master answers; exit with status 1 if it only accepts the request.

    A process that is stopped still accepts connections, and rospy waits for answers without a
    limit.
    """
    try:
        bounded_master("/start", limit).getPid()
    except TimeoutError:
        sys.exit(
            f"the ROS master at {rosgraph.get_master_uri()} has not answered within {limit:g} s; "
            "is it stopped, or the address wrong?"
        )
    # There is no master, or something else.
    except Exception:
        return False
    return True


@contextlib.contextmanager
def _watched_master(needs_master=lambda: False):
    """Exit with status 1 if the master falls silent within the block.

    Also after it, if ``needs_master()`` is true at its end.
    """
    has_ended = threading.Event()

    def watch():
        while not has_ended.wait(_WATCH_PERIOD):
            try:
                _answers()
            except SystemExit as error:
                if not has_ended.is_set():
                    print(error, file=sys.stderr, flush=True)
                    exit_at_once(1)

    threading.Thread(target=watch, name="master at start", daemon=True).start()
    try:
        yield
    finally:
        if not needs_master():
            has_ended.set()


def _wait_for_master(signals=None):
    uri, end = rosgraph.get_master_uri(), time.monotonic() + _MASTER_LIMIT
    is_told = False
    while not _answers():
        if not is_told:
            print(f"waiting for a ROS master at {uri}", file=sys.stderr)
        is_told = True
        if time.monotonic() > end:
            sys.exit(
                f"no ROS master at {uri} after {_MASTER_LIMIT:g} s; "
                "start one with roscore or roslaunch"
            )
        time.sleep(0.5)
        if signals:
            sys.exit(f"signal {signals[0]}: ended before a ROS master was found")


def _run(process, make_nodes, signals):
    handle = process.handle(rospy.get_name())
    nodes: dict[str, Node] = {}

    def needs_master():
        return any(node.needs_master for node in nodes.values())

    try:
        with _watched_master(needs_master), process.transport.starting():
            make = load(make_nodes) if isinstance(make_nodes, str) else make_nodes
            nodes = make(handle)
            refusal = namesake(set(nodes) - {handle.name})
            if refusal:
                raise ParameterError(f"{handle.name}: {refusal}")
            for name, node in nodes.items():
                if not node.initialize(process.handle(name)):
                    process.transport.log("fatal", f"{name}: not initialized; the process exits")
                    if process.is_refused:
                        _pause_refused(signals)
                    fail()
            shutdown = Shutdown(process, nodes, signals)
    except Exception as error:
        handle.error(initialization_failure(error))
        fail()
    rospy.on_shutdown(shutdown.run)
    watch = MasterWatch()
    watch.start()
    # A search for garbage among all imported objects takes 10 ms, and never finds any.
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    # Run in another thread: this one must be able to end the process if a callback does not return.
    threading.Thread(target=process.start, name="start", daemon=True).start()
    while not signals and process.exit_status is None and not rospy.is_shutdown():
        time.sleep(0.1)
    if len(signals) == 1 and not rospy.core.is_shutdown_requested():
        shutdown.wait_for_flights()
    watch.stop()
    rospy.signal_shutdown(f"signal {signals}" if signals else "the node has ended")
    # If another process requests it, a thread of rospy may run the shutdown.
    shutdown.has_ended.wait(_END_LIMIT)
    if process.recorder is not None:
        process.recorder.close()
    if shutdown.is_stuck:
        exit_at_once(1)
    sys.exit(process.exit_status or 0)


_SHUTDOWN_LIMIT = 2.0  #: Longest time that shutdown waits for a callback (s).

#: Longest time that a process continues for a flight that is to end (s): less than the 15 s that
#: roslaunch waits.
_FLIGHT_LIMIT = 10.0

#: Time that a process waits for another one to publish that its flight is to end, before it logs
#: that it waits (s).
_NOTICE_DELAY = 1.0

#: Time for rospy's threads to send the last messages, and for subscribers to read them (s): a
#: subscriber disconnects as soon as the master reports the publisher's end.
FLUSH_TIME = 0.2


def catch_signals() -> list[int]:
    """Return a list to which SIGINT and SIGTERM are added from now on.

    Call it before ``rospy.init_node``, whose handlers shut down inside the handler, where
    any lock may be held by the very code that was interrupted.
    """
    caught: list[int] = []
    ends = (signal.SIGINT, signal.SIGTERM)

    def note(number, _frame):
        caught.append(number)
        # After the first signal the process waits for flights; the next one ends that.
        if len(caught) > 1:
            for each in ends:
                signal.signal(each, signal.SIG_DFL)

    for each in ends:
        signal.signal(each, note)
    return caught


class Shutdown:
    """The shutdown of a process with nodes (by absolute name) before rospy closes connections.

    ``signals`` is the list of `catch_signals`.
    """

    def __init__(self, process: Process, nodes: dict[str, Node], signals: list[int]):
        self._process = process
        self._nodes = nodes
        self._signals = signals
        self.is_stuck = False  #: Whether a callback has not returned.
        self.has_ended = threading.Event()  #: Whether `run` is complete.
        needed = [name for name, node in nodes.items() if node.needed_in_flight]
        self._flights = Flights(process.topics, needed) if needed else None

    def run(self) -> None:
        """Stop timers and nodes, and wait until the last messages are sent.

        When another process asks for it (``rosnode kill``, a node with the same name), flights are
        waited for first, in a thread of rospy.
        """
        if not self._signals and self._process.exit_status is None:
            self.wait_for_flights()
        work = threading.Thread(target=self._process.shut_down, args=(self._nodes,), daemon=True)
        work.start()
        work.join(_SHUTDOWN_LIMIT)
        self.is_stuck = work.is_alive()
        if self.is_stuck:
            text = f"a callback has not returned within {_SHUTDOWN_LIMIT:g} s; exiting"
            self._process.transport.log("fatal", text)
        time.sleep(FLUSH_TIME)
        self.has_ended.set()

    def wait_for_flights(self) -> None:
        """Wait, 10 s at most, for flights that need these nodes; another signal ends that."""
        flights = self._flights
        if flights is None or not flights.in_flight:
            return
        # Reset before the log says that another signal ends the wait: one may come at once.
        begin, signals = time.monotonic(), len(self._signals)
        own = self._process.flights.in_flight
        notice_at = begin if own else begin + _NOTICE_DELAY
        # In another thread: a callback may never return.
        prepare = self._process.prepare_shutdown
        threading.Thread(target=prepare, args=(self._nodes,), name="end", daemon=True).start()
        while flights.in_flight and time.monotonic() < begin + _FLIGHT_LIMIT:
            if time.monotonic() >= notice_at:
                notice_at = math.inf
                if names := own or flights.unattended(2.0 * _NOTICE_DELAY):
                    self._process.transport.log(
                        "warn",
                        f"{listed(names, 'nodes')}: in flight; ends after the landing, or in "
                        f"{_FLIGHT_LIMIT:g} s; another signal ends at once",
                    )
            if len(self._signals) > signals:
                return
            time.sleep(0.05)


def fail() -> NoReturn:
    """End a process that cannot start, with status 1."""
    rospy.signal_shutdown("failed to initialize")
    exit_at_once(1)


def exit_at_once(status: int) -> NoReturn:
    """Exit even if threads, of rospy or stuck in a callback, would keep the process alive."""
    logging.shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
