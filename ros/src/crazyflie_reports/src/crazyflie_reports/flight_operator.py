"""Flights of the examples by a program."""

import contextlib
import math
import threading
import time
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Empty as EmptyMessage
from std_srvs.srv import Empty, EmptyRequest

from crazyflie_msgs.msg import (
    ControlStamped,
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_reports.flight_record import FlightRecord
from crazyflie_utils.flight_status import in_flight_of
from crazyflie_utils.main import ros_process
from crazyflie_utils.node import Process
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.vectors import to_vector


class FlightError(Exception):
    """The flight could not be flown; the text names the cause."""


class FlightOperator:
    """Takes off, hovers and lands through a vehicle's services, and records the flight.

    The process is not started yet; if several operators share it, the last one starts it
    (``start``). ``namespace`` is that of the vehicle's topics and services; nothing may take longer
    than ``limit``, s of the machine's clock.
    """

    def __init__(
        self, process: Process, namespace: str = "/", limit: float = 60.0, start: bool = True
    ):
        self._handle = handle = process.handle(f"{namespace.rstrip('/')}/flight_recorder")
        self._limit = limit
        self.record = record = FlightRecord()  #: Record of the flight so far.
        self._received = threading.Condition()  # Notified after every message.
        self._is_finished = False
        # Present state of the flight, and when each state last began (s).
        self._flight_state = FlightStatus.UNKNOWN
        self._began: dict[int, float] = {}
        for topic, message_type, series in (
            ("state", PositionVelocityYawStateStamped, record.state),
            ("ref", PositionVelocityStateStamped, record.reference),
            ("control/takeoff", ControlStamped, record.takeoff_control),
            ("control/final", ControlStamped, record.final_control),
        ):
            handle.subscribe(topic, message_type, partial(self._on_message, series))
        in_flight = in_flight_of(handle, namespace.rstrip("/"))
        handle.subscribe(in_flight, EmptyMessage, self._on_toggle)
        handle.subscribe(f"{in_flight}_flight_status", FlightStatus, self._on_status)
        self._reference = handle.publisher("ref", PositionVelocityStateStamped)
        if start:
            process.start()

    @property
    def position(self) -> NDArray[np.float64]:
        """Last position of the vehicle, m, shape (3,)."""
        return self.record.state.last[:3]

    @property
    def time(self) -> float:
        """Time of the latest state, s."""
        return self.record.state.last_time

    def finish(self) -> FlightRecord:
        """Stop recording and return the record."""
        with self._received:
            self._is_finished = True
        return self.record

    def wait_until_ready(self) -> None:
        """Wait for the first state and for the ground's zero thrust."""
        self._wait_for(lambda: len(self.record.state), "no state was published")
        self._wait_for(lambda: len(self.record.final_control), "no control was published")

    def takeoff(self) -> None:
        """Call takeoff, and wait for its answer and for the states of that time."""
        self._call("takeoff", "flying", FlightStatus.FLYING)

    def hover(self, duration: float) -> None:
        """Wait for ``duration`` seconds of flight."""
        state = self.record.state
        end = state.last_time + duration
        self._wait_for(lambda: state.last_time >= end, "states stopped coming")

    def refer_to(self, point: Sequence[float]) -> None:
        """Publish a point (x, y, z), m, as a reference at rest."""
        x, y, z = map(float, point)
        reference = PositionVelocityStateStamped(state=PositionVelocityState(x=x, y=y, z=z))
        reference.header.stamp = self._handle.stamp()
        self._reference.publish(reference)

    def land(self) -> None:
        """Call land and wait for its answer, and for the end of the motion."""
        self._call("land", "landed", FlightStatus.ON_GROUND)
        record = self.record
        end = record.events["landed"] + 0.5
        self._wait_for(lambda: record.state.last_time >= end, "states stopped coming")
        self._wait_for(lambda: record.final_control.last_time >= end, "controls stopped coming")

    def fly(self, hover: float) -> FlightRecord:
        """Take off, hover for some seconds and land; return the record, which is finished."""
        self.wait_until_ready()
        self.takeoff()
        self.hover(hover)
        self.land()
        return self.finish()

    def _call(self, service, answered, flight_state):
        record = self.record
        called_at = record.state.last_time
        future = self._handle.call_service(service, Empty, EmptyRequest(), self._limit)
        try:
            future.result()
        except ServiceError as error:
            raise FlightError(str(error)) from None
        record.events[service] = called_at
        record.events[answered] = record.state.last_time
        if not self._began:
            return
        # Messages may be later than the answer, by seconds where simulated time is fast.
        self._wait_for(
            lambda: self._began.get(flight_state, -math.inf) >= called_at,
            f"the server has answered {service}, and was not {answered}",
        )
        end = record.events[answered] = self._began[flight_state]
        self._wait_for(lambda: record.state.last_time >= end, "states stopped coming")

    def _on_message(self, series, message):
        content = message.control if isinstance(message, ControlStamped) else message.state
        self._note(series.append, message.header.stamp.to_sec(), to_vector(content))

    def _on_toggle(self, _):
        self._note(self.record.toggles.append, self._handle.stamp().to_sec())

    def _on_status(self, status):
        with self._received:
            if status.state != self._flight_state:
                self._flight_state = status.state
                self._began[status.state] = status.header.stamp.to_sec()
                self._received.notify_all()

    def _note(self, append, *values):
        with self._received:
            if not self._is_finished:
                append(*values)
                self._received.notify_all()

    def _wait_for(self, condition, failure):
        deadline = time.monotonic() + self._limit
        with self._received:
            while not condition():
                if not self._received.wait(deadline - time.monotonic()):
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
