"""The time of vehicles, by ROS."""

import threading
import time
from collections.abc import Callable

from typing_extensions import override

from crazyflie_mission_api.limits import MissionError
from crazyflie_mission_api.mission_vehicle import Clock
from crazyflie_utils import NodeHandle

_FROZEN = 10.0  #: How long simulated time may stand still, s of the machine's clock.


class RosClock(Clock):
    """The time of a process, real or simulated; ``has_ended()`` is whether ROS has shut down."""

    def __init__(self, handle: NodeHandle, has_ended: Callable[[], bool]):
        self._handle = handle
        self._has_ended = has_ended
        self._tick = threading.Condition()
        handle.timer(0.02, self._wake)

    @override
    def time(self) -> float:
        return self._handle.time()

    @override
    def wait_until(self, condition: Callable[[], bool], deadline: float) -> bool:
        last, moved_at = self.time(), time.monotonic()
        while not (done := condition()) and (now := self.time()) < deadline:
            if self._has_ended():
                raise MissionError("ROS has shut down; expected it to run as long as the mission")
            if now != last:
                last, moved_at = now, time.monotonic()
            elif time.monotonic() - moved_at > _FROZEN:
                raise MissionError(f"no /clock for {_FROZEN:g} s; is the simulation running?")
            with self._tick:
                self._tick.wait(0.1)
        return done

    def _wake(self):
        with self._tick:
            self._tick.notify_all()
