"""Simulated time, for the node that publishes it."""

import math
from collections.abc import Callable

from rosgraph_msgs.msg import Clock

from crazyflie_utils.clock import SimulatedClock, SteadyClock
from crazyflie_utils.timers import TimerQueue
from crazyflie_utils.topics import Publisher, Topics
from crazyflie_utils.transport import Transport


class ClockSource:
    """Publishes /clock, from a process with a simulated clock and timers."""

    def __init__(
        self,
        transport: Transport,
        topics: Topics,
        clock: SimulatedClock | SteadyClock,
        timers: TimerQueue,
    ):
        self._transport = transport
        self._topics = topics
        self._clock = clock
        self._timers = timers
        self._publisher: Publisher | None = None

    def publisher(self) -> Callable[..., None]:
        """Return ``set_clock(*moments)``, which moves simulated time to moments (s).

        Other processes are sent all of them, at once. In this process time moves to the last
        one, after the present callback; then the timers that are due run.
        """
        publisher = self._publisher = self._topics.publisher("/clock", Clock, latch=False)

        def set_clock(*moments: float) -> None:
            stamp = self._clock.stamp(moments[-1])
            self._transport.clock_was_set(stamp)
            passed = moments[:-1] if publisher.is_heard_outside() else ()
            publisher.publish(Clock(stamp), [Clock(self._clock.stamp(each)) for each in passed])

        return set_clock

    def next_event(self) -> float:
        """Return the next moment, s, at which simulated time must stop.

        That is when a timer of this process is due; or at once, where /clock has another subscriber
        in this process than the process itself.
        """
        if self._publisher is None or self._publisher.is_read_here(excluding=1):
            return -math.inf
        return self._timers.next_deadline()
