"""Base class of flights by a stream of setpoints, which starts with its first subscriber."""

from concurrent.futures import Future
from functools import partial
from typing import Any

import genpy
from typing_extensions import override

from crazyflie_demo.flight_plan_node import seconds
from crazyflie_driver.setpoint_gate import OVERLAP
from crazyflie_driver.srv import Land, LandRequest
from crazyflie_utils import Node, NodeHandle

_LANDING = 2.0  #: Duration of the landing after an interrupted flight, s.
_LIMIT = 15.0  #: Longest time of a service call, s.
_FINISH_LIMIT = 10.0  #: Longest time in which a failed landing is requested again, s.
_RETRY_PERIOD = 1.0  #: Between two requests, s.

#: Longest time of a landing's service call, s. `OVERLAP` after the landing the driver passes
#: setpoints on again, which override it: one that is accepted later is requested again.
_MAX_ANSWER_TIME = OVERLAP / 2.0


class StreamNode(Node):
    """Stream the setpoints of a flight as soon as the driver subscribes; then end the process.

    The last setpoint is repeated until the driver has accepted `finish`: without setpoints the
    firmware levels out after 0.5 s and stops the motors after 2 s. If the node is ended in
    flight, the vehicle is landed. A subclass sets topic, message type, duration (s) and rate (Hz)
    at the latest in `load_parameters`.
    """

    topic: str
    message_type: type
    duration: float
    rate: float

    def __init__(self) -> None:
        self._start: float | None = None
        self._is_flying = False
        self._next_finish: float | None = 0.0

    def setpoint(self, time: float) -> genpy.Message:
        """Return the setpoint of a time (s), 0 to `duration`."""
        raise NotImplementedError

    def finish(self) -> Future[Any] | None:
        """Request what follows the last setpoint; the process ends after the response."""
        return None

    def land(self) -> Future[Any]:
        """Request a landing by the high-level commander; return the response."""
        prefix = self._handle.resolve(self.topic).rpartition("/")[0]
        request = LandRequest(height=0.0, duration=seconds(_LANDING))
        return self._handle.call_service(f"{prefix}/land", Land, request, _LIMIT)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher(self.topic, self.message_type)
        self._timer = handle.timer(1.0 / self.rate, self._on_timer)
        handle.info(f"waiting for {handle.resolve(self.topic)}")

    @override
    def enter_safe_state(self) -> None:
        if self._is_flying:
            self._is_flying = False
            self._handle.warn("landing")
            self.land()

    def _on_timer(self):
        now = self._handle.time()
        if self._start is None:
            # Setpoints without a subscriber are lost, and the flight would start in its middle.
            if not self._publisher.has_subscribers():
                return
            self._start = now
            self._finish_end = now + self.duration + _FINISH_LIMIT
            self._is_flying = True
            self._handle.info(f"flying, {self.duration:g} s")
        elapsed = now - self._start
        message = self.setpoint(min(elapsed, self.duration))
        message.header.stamp = self._handle.stamp()
        self._publisher.publish(message)
        if elapsed >= self.duration and self._next_finish is not None and now >= self._next_finish:
            self._next_finish = None
            answer = self.finish()
            if answer is None:
                self._end()
            else:
                answer.add_done_callback(partial(self._on_answer, now))

    def _on_answer(self, asked, done):
        now, error = self._handle.time(), done.exception()
        if error is None and now - asked <= _MAX_ANSWER_TIME:
            self._end()
        elif error is None:
            self._next_finish = now
        elif now < self._finish_end:
            self._handle.warn(f"the landing has failed, and is tried again: {error}")
            self._next_finish = now + _RETRY_PERIOD
        else:
            self._handle.error(
                f"MAY STILL FLY: the landing has failed for {_FINISH_LIMIT:g} s: {error}"
            )
            self._handle.end(1)

    def _end(self):
        self._is_flying = False
        self._timer.stop()
        self._handle.end(0)
