"""The base class of all nodes, and the process in which they run."""

import threading
import traceback
from functools import partial
from typing import Any, ClassVar, Generic, get_args

from typing_extensions import TypeVar

from crazyflie_utils.context import ProcessContext
from crazyflie_utils.handle import NodeHandle
from crazyflie_utils.parameters.declaration import ParameterError, Parameters
from crazyflie_utils.program import missing_module

P = TypeVar("P", bound=Parameters, default=Any)


def initialization_failure(error: Exception) -> str:
    """Return why a node cannot be initialized: parameters, a package to install, or a traceback."""
    if isinstance(error, ParameterError):
        return str(error)
    trace = "".join(traceback.format_exception(error))
    return missing_module(error) or f"failed to initialize\n{trace}"


class Node(Generic[P]):
    """A ROS node as an object, which is initialized with a `NodeHandle`.

    A subclass ``MyNode(Node[MyParameters])`` overrides `register_callbacks`, and `load_parameters`
    if it has an algorithm to build, and `enter_safe_state` if silence is not safe enough.
    ``__init__`` defines the state of the node, and makes no ROS call.

    Callbacks never run before `initialize` has returned and never at the same time, so a node
    needs no locks.
    """

    #: What callbacks read that does not come through the handle, and is not in a journal (text).
    sources: ClassVar[str] = ""

    #: What the node acts on outside of ROS, such as vehicles (text): it is run again from its
    #: journal, where that is not there, and in no other way.
    effects: ClassVar[str] = ""

    #: Whether a process with this node continues after SIGINT until flights have ended.
    needed_in_flight: ClassVar[bool] = False

    #: Whether a process with this node, which does its work and ends, ends with status 1 if the
    #: master is silent; others need it at the start only.
    needs_master: ClassVar[bool] = False

    parameters_type: type[Any]  #: Declaration of the parameters: ``P`` of ``Node[P]``.

    _handle: NodeHandle
    _parameters: P

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        for base in cls.__dict__.get("__orig_bases__", ()):
            for argument in get_args(base):
                if isinstance(argument, type) and issubclass(argument, Parameters):
                    cls.parameters_type = argument

    def initialize(self, handle: NodeHandle) -> bool:
        """Load parameters, register callbacks; return False if that fails, and log the reason."""
        self._handle = handle
        try:
            self.load_parameters(handle)
            self.register_callbacks(handle)
            handle.warn_unknown_parameters()
        except Exception as error:
            handle.error(initialization_failure(error))
            return False
        handle.on_fault(self.enter_safe_state)
        return True

    def load_parameters(self, handle: NodeHandle) -> None:
        """Load the parameters, with `NodeHandle.load`, and build the algorithm.

        By default `parameters_type` is loaded, and its live parameters may be changed. May raise
        `ParameterError`, with full names and the expected values.
        """
        self._parameters = handle.load(self.parameters_type, self._reconfigure)

    def _reconfigure(self, parameters: P) -> None:
        self._parameters = parameters

    def register_callbacks(self, handle: NodeHandle) -> None:
        """Create publishers, services, subscribers and timers, in this order."""
        raise NotImplementedError

    def enter_safe_state(self) -> None:
        """Put the vehicle into a safe state after an exception of a callback, and at shutdown.

        By default the node publishes nothing, and the vehicle's watchdog acts.
        """

    def prepare_shutdown(self) -> None:
        """Start to end a flight. Called at SIGINT, after which callbacks still run for a while."""

    def shutdown(self) -> None:
        """Clean up: called once, when timers no longer fire and topics still work."""
        self.enter_safe_state()


class Process(ProcessContext):
    """A process with any number of nodes, which are passed by absolute name at its end."""

    def handle(self, name: str) -> NodeHandle:
        """Return the handle of the node with this absolute name."""
        return NodeHandle(self, name)

    def start(self) -> None:
        """Start to run callbacks: every node is complete."""
        if self.recorder is not None:
            self.recorder.end_start()
        self.executor.start()
        self._steady.start()

    def stop(self) -> None:
        """Stop all timers."""
        self._steady.stop()
        self._simulated.stop()

    def prepare_shutdown(self, nodes: dict[str, Node]) -> None:
        """Call `prepare_shutdown` of every node, and publish that flights are to end."""

        def begin():
            self.is_ending = True
            self.flights.publish_ending()

        works = [self.handle(name).guard(node.prepare_shutdown) for name, node in nodes.items()]
        self._post_all("PREPARE_SHUTDOWN", [begin, *works])

    def shut_down(self, nodes: dict[str, Node]) -> None:
        """Stop all timers, and make the vehicle of every node safe; wait for that."""
        has_ended = self.begin_shutdown(nodes)
        if self.executor.is_started:
            has_ended.wait()

    def begin_shutdown(self, nodes: dict[str, Node]) -> threading.Event:
        """Do the same as a task, whose end is an event: a node may wait for its vehicle."""
        works = [self.handle(name).guard(node.shutdown) for name, node in nodes.items()]
        has_ended = threading.Event()

        def work():
            try:
                for each in works:
                    each()
            finally:
                has_ended.set()

        self._post_all("SHUTDOWN", [self.stop, partial(self.tasks.start, "shutdown", work)])
        return has_ended

    def _post_all(self, kind, works):
        def run():
            for work in works:
                self.executor.submit(work)

        if self.recorder is None:
            self.executor.submit(run)
        else:
            self.recorder.post(kind, run)
