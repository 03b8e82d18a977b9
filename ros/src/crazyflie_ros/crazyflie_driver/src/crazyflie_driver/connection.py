"""The connection to a vehicle: from the first attempt to its end, and after every loss."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future

from crazyflie_driver.delivery import Delivery
from crazyflie_driver.jobs import Jobs
from crazyflie_driver.setpoint_gate import Event, SetpointGate
from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_link.errors import NoAnswerError
from crazyflie_utils import NodeHandle, ServiceError

PAUSE = 0.2
"""Between two attempts, s."""


def connect_within(
    limit: float,
    connect: Callable[[], None],
    is_leaving: Callable[[], bool],
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Call ``connect()`` again and again while the vehicle does not answer; blocks.

    Parameters
    ----------
    limit : float
        Time after which no new attempt is made, s; there is always one.
    connect : callable
        Makes one attempt.
    is_leaving : callable
        Whether the vehicle is being removed, which ends the attempts.
    clock, sleep : callable
        For tests.

    Raises
    ------
    NoAnswerError
        The vehicle has not answered within the limit.
    CrazyflieError
        Another error of an attempt, which is not repeated.
    """
    end = clock() + limit
    while True:
        try:
            return connect()
        except NoAnswerError:
            if is_leaving() or clock() >= end:
                raise
        sleep(PAUSE)


class Connection:
    """Connect to a vehicle once, follow its link, and end the connection.

    Parameters
    ----------
    handle : NodeHandle
        Of the server.
    own : NodeHandle
        Of the vehicle; is closed in the end.
    name : str
        Of the vehicle, for messages.
    crazyflie : crazyflie_link.Crazyflie
    gate : SetpointGate
    jobs : Jobs
    delivery : Delivery
    publish : callable
        ``publish()`` publishes the vehicle's status.

    Attributes
    ----------
    text : str
        Why the link is in its state.
    is_leaving : bool
        Whether the vehicle is being removed.
    is_established : bool
        Whether the vehicle has been connected, and its topics and services are there.
    """

    def __init__(
        self,
        handle: NodeHandle,
        own: NodeHandle,
        name: str,
        crazyflie: Crazyflie,
        gate: SetpointGate,
        jobs: Jobs,
        delivery: Delivery,
        publish: Callable[[], None],
    ):
        self.text = f"connecting to {crazyflie.address.uri}"
        self.is_leaving = False
        self.is_established = False
        self._handle = handle
        self._own = own
        self._name = name
        self._crazyflie = crazyflie
        self._gate = gate
        self._jobs = jobs
        self._delivery = delivery
        self._publish = publish
        # Held while topics and services are announced, or taken down.
        self._announcing = threading.Lock()
        self._connection_count = 0

    def connect(
        self, limit: float, prepare: Callable[[], None], announce: Callable[[], None]
    ) -> None:
        """Connect, or end everything and raise; blocks.

        Parameters
        ----------
        limit : float
            See `connect_within`.
        prepare, announce : callable
            Are called with a link, the second one only if the vehicle is not being removed.
        """
        try:
            connect_within(limit, self._crazyflie.connect, lambda: self.is_leaving)
            prepare()
            with self._announcing:
                if self.is_leaving:
                    raise ServiceError("removed while connecting")
                self._connection_count = self._crazyflie.connection_count
                announce()
                self.is_established = True
        except BaseException:
            self.is_leaving = True
            self.end()
            raise
        self._delivery.submit(self._publish)
        self._handle.info(f"{self._name}: connected to {self._crazyflie.address.uri}")

    def leave(self, before: Callable[[], str]) -> Future[str]:
        """End the connection, also while it is being set up; does not block.

        Parameters
        ----------
        before : callable
            ``before()`` is called first, in a thread; it returns what could not be done.

        Returns
        -------
        Future of str
            The same.
        """
        self.is_leaving = True
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

        threading.Thread(target=work, name=f"{self._name}-leave", daemon=True).start()
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
        """Take note of the link's state; from the link's own thread.

        Parameters
        ----------
        state : LinkState
        text : str
            Why it is in this state.
        resume : callable
            Is called, as a job, after a new set-up; the link of before needs none.
        """
        # At the end nothing may wait for the callbacks' turn, since the node waits for the end.
        self.text = text
        if state is LinkState.LOST:
            self._gate.handle(Event.LINK_LOST)
        elif state is LinkState.CONNECTED:
            self._gate.handle(Event.LINK_BACK)
        if not self.is_leaving:
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
