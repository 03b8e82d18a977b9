"""Flights of the examples by a program."""

import contextlib
import time
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from std_srvs.srv import Empty, EmptyRequest

from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_reports.flight_record import FlightRecord
from crazyflie_reports.flight_recorder_node import FlightRecorderNode
from crazyflie_utils.main import ros_process
from crazyflie_utils.process import Process
from crazyflie_utils.transport import ServiceError


class FlightError(Exception):
    """The flight could not be flown; the text says what went wrong."""


class FlightOperator:
    """Takes off, hovers and lands through a vehicle's services, and records the flight.

    The process is not started yet; where several operators share it, the last one does (``start``).
    ``namespace`` is that of the vehicle's topics and services; nothing may take longer than
    ``limit``, s of the machine's clock.
    """

    def __init__(
        self, process: Process, namespace: str = "/", limit: float = 60.0, start: bool = True
    ):
        self._handle = process.handle(f"{namespace.rstrip('/')}/flight_recorder")
        self._limit = limit
        self._recorder = FlightRecorderNode()
        if not self._recorder.initialize(self._handle):
            raise FlightError("the flight recorder could not be started; see the log")
        self._reference = self._handle.publisher("ref", PositionVelocityStateStamped)
        if start:
            process.start()

    @property
    def position(self) -> NDArray[np.float64]:
        """Where the vehicle was last, m, shape (3,)."""
        return self._recorder.record.state.last[:3]

    @property
    def time(self) -> float:
        """Of the latest state, s."""
        return self._recorder.record.state.last_time

    def finish(self) -> FlightRecord:
        """Stop recording and return the record."""
        self._recorder.stop()
        return self._recorder.record

    def wait_until_ready(self) -> None:
        """Wait for the first state and for the ground's zero thrust."""
        record = self._recorder.record
        self._wait_for(lambda: len(record.state), "no state was published")
        self._wait_for(lambda: len(record.final_control), "no control was published")

    def takeoff(self) -> None:
        """Call takeoff and wait for its answer."""
        self._call("takeoff", "flying")

    def hover(self, duration: float) -> None:
        """Let ``duration`` seconds of flight pass."""
        state = self._recorder.record.state
        end = state.last_time + duration
        self._wait_for(lambda: state.last_time >= end, "states stopped coming")

    def refer_to(self, point: Sequence[float]) -> None:
        """Publish a point (x, y, z), m, as reference, to be at rest there."""
        x, y, z = map(float, point)
        reference = PositionVelocityStateStamped(state=PositionVelocityState(x=x, y=y, z=z))
        reference.header.stamp = self._handle.stamp()
        self._reference.publish(reference)

    def land(self) -> None:
        """Call land and wait for its answer, and for what the vehicle does then."""
        self._call("land", "landed")
        self.hover(0.5)

    def fly(self, hover: float) -> FlightRecord:
        """Take off, hover for some seconds and land; return the record, which is finished."""
        self.wait_until_ready()
        self.takeoff()
        self.hover(hover)
        self.land()
        return self.finish()

    def _call(self, service, answered):
        record = self._recorder.record
        called_at = record.state.last_time
        future = self._handle.call_service(service, Empty, EmptyRequest(), self._limit)
        try:
            future.result()
        except ServiceError as error:
            raise FlightError(str(error)) from None
        record.events[service] = called_at
        record.events[answered] = record.state.last_time

    def _wait_for(self, condition, failure):
        deadline = time.monotonic() + self._limit
        with self._recorder.received:
            while not condition():
                if not self._recorder.received.wait(deadline - time.monotonic()):
                    raise FlightError(f"{failure} for {self._limit:g} s")


@contextlib.contextmanager
def ready_operator() -> Iterator[FlightOperator]:
    """Yield an operator that is ready to take off, in a rostest's own process."""
    process = ros_process()
    operator = FlightOperator(process)
    operator.wait_until_ready()
    try:
        yield operator
    finally:
        process.stop()
