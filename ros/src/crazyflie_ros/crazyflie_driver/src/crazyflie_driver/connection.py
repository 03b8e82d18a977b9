"""The connection to a vehicle: from the first attempt to its end, and after every loss."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field

from crazyflie_driver.delivery import Delivery
from crazyflie_driver.jobs import Jobs
from crazyflie_driver.setpoint_gate import Event, SetpointGate
from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_link.errors import NoAnswerError
from crazyflie_utils import NodeHandle, ServiceError

PAUSE = 0.2  #: Between two attempts, s.


def connect_within(
    limit: float,
    connect: Callable[[], None],
    is_closing: Callable[[], bool],
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Call ``connect()`` again and again while the vehicle does not answer; blocks.

    Raises the last `NoAnswerError` after a limit (s) or once ``is_closing()``; other errors at
    once.
    """
    end = clock() + limit
    while True:
        try:
            return connect()
        except NoAnswerError:
            if is_closing() or clock() >= end:
                raise
        sleep(PAUSE)


@dataclass(eq=False)
class Connection:
    """Connect to a vehicle once, follow its link, and end the connection.

    It is established once the vehicle has been connected, and its topics and services are there.
    The text says why the link is in its state; ``_publish()`` publishes the vehicle's status.
    """

    # Of the server, and of the vehicle; the second one is closed in the end.
    _handle: NodeHandle
    _own: NodeHandle
    _name: str
    _crazyflie: Crazyflie
    _gate: SetpointGate
    _jobs: Jobs
    _delivery: Delivery
    _publish: Callable[[], None]
    text: str = field(init=False)
    is_closing: bool = False
    is_established: bool = False
    # Held while topics and services are announced, or taken down.
    _announcing: threading.Lock = field(default_factory=threading.Lock)
    _connection_count: int = 0

    def __post_init__(self) -> None:
        self.text = f"connecting to {self._crazyflie.address.uri}"

    @property
    def is_connected(self) -> bool:
        """Whether there is a link now."""
        return self._crazyflie.state is LinkState.CONNECTED

    def connect(
        self, limit: float, prepare: Callable[[], None], announce: Callable[[], None]
    ) -> None:
        """Connect within a limit (s), or end everything and raise; blocks.

        With a link ``prepare()`` is called, then ``announce()`` if the vehicle is not being
        removed.
        """
        try:
            connect_within(limit, self._crazyflie.connect, lambda: self.is_closing)
            prepare()
            with self._announcing:
                if self.is_closing:
                    raise ServiceError("removed while connecting")
                self._connection_count = self._crazyflie.connection_count
                announce()
                self.is_established = True
        except BaseException:
            self.is_closing = True
            self.end()
            raise
        self._delivery.submit(self._publish)
        self._handle.info(f"{self._name}: connected to {self._crazyflie.address.uri}")

    def close(self, before: Callable[[], str]) -> Future[str]:
        """End the connection, also while it is being set up; does not block.

        First ``before()`` is called, in a thread; what it returns is the result.
        """
        self.is_closing = True
        self._gate.handle(Event.REMOVAL)
        self._jobs.supersede("the removal")
        done: Future[str] = Future()

        def work():
            try:
                problem = before()
                self.end()
                done.set_result(problem)
            except BaseException as error:
                done.set_exception(error)

        threading.Thread(target=work, name=f"{self._name}-close", daemon=True).start()
        return done

    def end(self) -> None:
        """Close the link, and take topics and services down."""
        # First the link: that ends the wait for answers in `connect`.
        self._crazyflie.close()
        with self._announcing:
            self._own.close()
        self._delivery.close()
        self._jobs.close()

    def on_state(self, state: LinkState, text: str, resume: Callable[[], None]) -> None:
        """Take note of the link's state, and why it is that; from the link's own thread.

        After a new set-up ``resume()`` is called as a job; the link of before needs none.
        """
        # At the end nothing may wait for the callbacks' turn, since the node waits for the end.
        self.text = text
        if state is LinkState.LOST:
            self._gate.handle(Event.LINK_LOST)
        elif state is LinkState.CONNECTED:
            self._gate.handle(Event.LINK_BACK)
        if not self.is_closing:
            self._delivery.submit(self._report, state, text, resume)

    def _report(self, state, text, resume):
        self._publish()
        if state is LinkState.LOST:
            self._handle.error(f"{self._name}: {text}; trying to connect again")
        elif state is LinkState.CONNECTED and self.is_established:
            self._handle.warn(f"{self._name}: {text}")
            self._jobs.submit("taking up the link again", lambda _: self._resume(resume))

    def _resume(self, resume):
        count = self._crazyflie.connection_count
        if self._gate.is_emergency or self._connection_count == count:
            return
        self._connection_count = count
        resume()
