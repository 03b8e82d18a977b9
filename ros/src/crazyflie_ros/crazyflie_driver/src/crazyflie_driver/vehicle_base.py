"""What the parts of one vehicle share: the states of its connection, its data and its jobs.

Jobs are tasks, in turn with callbacks, which wait for the vehicle; the thread of the delivery
brings its data in turn.
"""

import contextlib
import enum
import math
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError, wait
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

from crazyflie_driver.driver_parameters import CrazyflieServerParameters, VehicleParameters
from crazyflie_driver.setpoint_gate import SetpointGate
from crazyflie_link.errors import CrazyflieError, LinkLostError, NoReplyError
from crazyflie_utils import NodeHandle, ParameterError, ServiceError
from crazyflie_utils.topics import Publisher

Result = TypeVar("Result")

#: Largest number of queued jobs. Largest number of queued data; more are dropped. A vehicle logs
#: some 300 packets a second.
MOST_JOBS = 64
MAX_WAITING = 1000

_UNANSWERED = LinkLostError, NoReplyError

StartTask = Callable[[str, Callable[[], None]], None]  #: See `NodeHandle.task`.


def awaited(handle: NodeHandle, future: Future[Result], limit: float) -> Result:
    """Return the result of a future; a task waits for it, at most ``limit`` s (TimeoutError)."""
    handle.outside(wait, [future], limit)
    return future.result(0.0)


class News:
    """Something new, which tasks wait for."""

    def __init__(self, handle: NodeHandle):
        self._handle = handle
        self._awaited: list[threading.Event] = []

    def wait(self, limit: float) -> bool:
        """Wait in a task for the next `tell`, at most ``limit`` s; return whether it came."""
        has_come = threading.Event()
        self._awaited.append(has_come)
        self._handle.outside(has_come.wait, limit)
        return has_come.is_set()

    def tell(self) -> None:
        """Let all go on that wait."""
        while self._awaited:
            self._awaited.pop().set()


@dataclass(eq=False)
class Job:
    """A call ``work(job)``, which takes time, and which something else may supersede.

    A caller that waits no longer cancels `done`: the job is not begun, or may send nothing more.
    """

    work: Callable[["Job"], Any]
    superseded_by: str = ""
    is_begun: bool = False
    done: Future[Any] = field(default_factory=Future)

    def may_send(self) -> bool:
        """Return whether nothing has superseded it, and its result is awaited."""
        return not (self.superseded_by or self.done.cancelled())

    def check(self) -> None:
        """Raise `ServiceError` unless it may send."""
        if not self.may_send():
            raise ServiceError(self.end_text())

    def end_text(self) -> str:
        """Return why it may not send."""
        return f"given up for {self.superseded_by or 'its caller, who waits no longer'}"

    def start(self, start: StartTask, name: str) -> Future[Any]:
        """Do the job as a task of its own with a name; return the future of its result."""
        start(name, self.run)
        return self.done

    def run(self) -> None:
        """Call `work`; result or error go to `done`."""
        self.is_begun = True
        # It may have been cancelled or superseded meanwhile.
        with contextlib.suppress(InvalidStateError):
            try:
                self.check()
                self.done.set_result(self.work(self))
            except Exception as error:
                self.done.set_exception(error)


class _Lane:
    """Jobs that are done one after the other, by a task that lasts while there are any."""

    def __init__(self, start: StartTask, name: str):
        self.waiting: deque[Job] = deque()
        self._start, self._name = start, name
        self._is_running = False

    def put(self, job: Job) -> None:
        """Queue a job."""
        self.waiting.append(job)
        if not self._is_running:
            self._is_running = True
            self._start(self._name, self._run)

    def _run(self):
        while self.waiting:
            self.waiting.popleft().run()
        self._is_running = False


class Jobs:
    """A queue with a lane for urgent jobs; a task for each lane does its jobs in their order.

    Urgent jobs supersede every flight job that was submitted before them: one that has not begun is
    given up, a running one is marked. When a job fails, ``on_error(text)`` is called. Everything
    is used in turn with callbacks; ``start`` starts a task.
    """

    def __init__(
        self, name: str, start: StartTask, on_error: Callable[[str], None] = lambda text: None
    ):
        self._on_error = on_error
        #: How often flight jobs were superseded, and by what at last.
        self.superseded: tuple[int, str] = 0, ""
        self._lane, self._urgent_lane = _Lane(start, name), _Lane(start, f"{name}-urgent")
        self._flights: list[Job] = []
        self._is_closed = False

    def submit(
        self,
        what: str,
        work: Callable[[Job], Result],
        is_flight: bool = False,
        urgent: bool = False,
    ) -> Future[Result]:
        """Queue ``work(job)`` behind the jobs before it; return the future of its result.

        An urgent one waits for earlier urgent ones only. Errors are logged; those of the link and
        of parameters fail the future with `ServiceError`.
        """

        def run(job):
            try:
                return work(job)
            except (CrazyflieError, ParameterError, ServiceError) as error:
                # A request that is held back ends like an unanswered one.
                is_held_back = job.superseded_by and isinstance(error, _UNANSWERED)
                text = job.end_text() if is_held_back else str(error)
                self._on_error(f"{what} failed: {text}")
                raise ServiceError(text) from None
            except Exception as error:
                # The caller may never read the future's result.
                self._on_error(f"{what} failed: {error!r}")
                raise

        if urgent:
            self.supersede(what)
        job = Job(run)
        lane = self._urgent_lane if urgent else self._lane
        if self._is_closed:
            job.done.set_exception(ServiceError("the vehicle has been removed"))
        elif len(lane.waiting) >= MOST_JOBS:
            job.done.set_exception(ServiceError(f"{MOST_JOBS} calls wait for the vehicle"))
        else:
            lane.put(job)
            if is_flight and not urgent:
                self._flights = [each for each in self._flights if not each.done.done()]
                self._flights.append(job)
        return job.done

    def supersede(self, what: str) -> None:
        """Give up all flight jobs for something else.

        Callers of those that have not begun are told at once. A running one may be carried out
        already, which its end tells.
        """
        flights, self._flights = self._flights, []
        self.superseded = self.superseded[0] + 1, what
        for job in flights:
            job.superseded_by = what
            if not job.is_begun:
                # It does nothing but fail, here and in its turn.
                job.run()

    def close(self) -> None:
        """Take no more jobs; those that wait are done."""
        self._is_closed = True


class Delivery:
    """A thread through which a link's threads call the node's callbacks without blocking.

    A function of `NodeHandle.input` returns when its callback has run, and that waits for all
    callbacks before it. A link whose thread blocks on that receives nothing meanwhile.
    """

    def __init__(self, handle: NodeHandle, name: str):
        self._callbacks: list[Callable[..., None]] = []
        self._pass_on = handle.input(self._call)
        self._queue: queue.SimpleQueue[tuple[int, tuple[Any, ...]]] = queue.SimpleQueue()
        self._is_closed = False
        thread = threading.Thread(target=self._run, name=f"{name}-delivery", daemon=True)
        handle.start(thread.start)

    def outlet(self, callback: Callable[..., None], are_data: bool = False) -> Callable[..., None]:
        """Return a function for threads that calls the callback in turn, and does not block.

        Its arguments must be JSON. Data are dropped when too many wait.
        """
        self._callbacks.append(callback)
        most = MAX_WAITING if are_data else math.inf
        return partial(self._put, len(self._callbacks) - 1, most)

    def close(self) -> None:
        """Stop calling; discard the queue."""
        self._is_closed = True
        self._queue.put((0, ()))

    def _put(self, number, most, *arguments):
        if self._queue.qsize() < most:
            self._queue.put((number, arguments))

    def _run(self):
        while not self._is_closed:
            self._pass_on(self._queue.get())

    def _call(self, known):
        number, arguments = known
        # In turn with `close`, which puts what is none.
        if not self._is_closed:
            self._callbacks[number](*arguments)


class ConnectionState(enum.Enum):
    """State of a vehicle of the server, from adding to removing."""

    CONNECTING = enum.auto()  #: The first link is tried.
    SETTING_UP = enum.auto()  #: Log blocks are started, topics and services announced.
    READY = enum.auto()
    LOST = enum.auto()  #: There is no link, or it is silent.
    RESUMING = enum.auto()  #: On a new link the vehicle is set up again.
    CLOSING = enum.auto()  #: The vehicle is landed or stopped, and removed.
    CLOSED = enum.auto()


class ConnectionEvent(enum.Enum):
    """An event that changes a `ConnectionState`."""

    LINK_OPENED = enum.auto()  #: For the first time.
    ANNOUNCED = enum.auto()
    LINK_LOST = enum.auto()
    LINK_HEARD = enum.auto()  #: The link is the one from before the loss.
    LINK_RENEWED = enum.auto()
    RESUMED = enum.auto()
    REMOVAL = enum.auto()  #: It is to be removed, or could not be connected.
    REMOVED = enum.auto()


_STATE, _EVENT = ConnectionState, ConnectionEvent

#: (state, event) -> next state; an event without an entry changes nothing.
TRANSITIONS: dict[tuple[ConnectionState, ConnectionEvent], ConnectionState] = {
    (_STATE.CONNECTING, _EVENT.LINK_OPENED): _STATE.SETTING_UP,
    (_STATE.SETTING_UP, _EVENT.ANNOUNCED): _STATE.READY,
    (_STATE.READY, _EVENT.LINK_LOST): _STATE.LOST,
    # The link may have been lost while the vehicle was set up.
    (_STATE.READY, _EVENT.LINK_RENEWED): _STATE.RESUMING,
    (_STATE.LOST, _EVENT.LINK_HEARD): _STATE.READY,
    (_STATE.LOST, _EVENT.LINK_RENEWED): _STATE.RESUMING,
    (_STATE.RESUMING, _EVENT.LINK_LOST): _STATE.LOST,
    (_STATE.RESUMING, _EVENT.RESUMED): _STATE.READY,
    **{
        (state, _EVENT.REMOVAL): _STATE.CLOSING
        for state in _STATE
        if state not in (_STATE.CLOSING, _STATE.CLOSED)
    },
    (_STATE.CLOSING, _EVENT.REMOVED): _STATE.CLOSED,
}


@dataclass(eq=False)
class BaseVehicle:
    """Common data of all parts of one vehicle, which are attributes of `DriverVehicle`.

    The handle is closed when the vehicle is removed. Calls that block on the vehicle are jobs.
    ``crazyflie`` is a `Crazyflie` as an `External`; ``link_text`` says why the link is in its
    state.
    """

    handle: NodeHandle
    parameters: VehicleParameters
    server: CrazyflieServerParameters
    crazyflie: Any
    gate: SetpointGate
    jobs: Jobs
    delivery: Delivery
    link_text: str
    state: ConnectionState = ConnectionState.CONNECTING

    def transition(self, event: ConnectionEvent) -> ConnectionState:
        """Change the state by an event, and return it."""
        self.state = TRANSITIONS.get((self.state, event), self.state)
        return self.state

    def monotonic(self) -> float:
        """Return the machine's time, s, for time limits of tasks."""
        return float(self.handle.value("time", time.monotonic))

    def sleep(self, duration: float) -> None:
        """Wait in a task, s."""
        self.handle.outside(time.sleep, duration)

    def is_ready(self) -> bool:
        """Return whether topics and services exist; also while the link is lost."""
        return self.state in (ConnectionState.READY, ConnectionState.LOST, ConnectionState.RESUMING)

    def is_closing(self) -> bool:
        """Return whether the vehicle is being removed, or has been."""
        return self.state in (ConnectionState.CLOSING, ConnectionState.CLOSED)

    def publisher(self, name: str, message_type: type, latch: bool = False) -> Publisher:
        """Announce a topic of the vehicle; see `NodeHandle.publisher`."""
        return self.handle.publisher(f"{self.parameters.prefix}/{name}", message_type, latch)

    def info(self, text: str) -> None:
        """Log information about the vehicle."""
        self.handle.info(f"{self.parameters.name}: {text}")

    def warn(self, text: str, throttle: float = 0.0, key: str = "") -> None:
        """Log a warning about the vehicle; see `NodeLog.warn`."""
        name = self.parameters.name
        self.handle.warn(f"{name}: {text}", throttle, (name, key or text))

    def error(self, text: str) -> None:
        """Log an error of the vehicle."""
        self.handle.error(f"{self.parameters.name}: {text}")

    def refuse_after_emergency(self) -> None:
        """Raise `ServiceError` after an emergency stop, which holds until the removal."""
        if self.gate.is_emergency:
            raise ServiceError(
                f"emergency stop: remove {self.parameters.uri}, restart the vehicle and add it "
                "again"
            )

    def refuse_to_arm_in_stream(self) -> None:
        """Raise `ServiceError` while setpoints come that would start the motors of an armed one."""
        if reason := self.gate.arming_refusal(self.handle.time()):
            raise ServiceError(f"{self.parameters.name} is not armed: {reason}")
