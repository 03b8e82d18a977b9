"""A node's time: clock, timers, and the order of its callbacks."""

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import genpy
from rosgraph_msgs.msg import Clock

from crazyflie_utils.handle_base import HandleBase
from crazyflie_utils.timers import Timer
from crazyflie_utils.topics import Publisher

if TYPE_CHECKING:
    from crazyflie_utils.process import Process


class VaryingTimer:
    """A timer whose period can change; see `NodeHandle.varying_timer`."""

    def __init__(self, begin: Callable[[float, bool], Timer], period: float):
        self._begin = begin
        self._period = period
        self._timer = begin(period, False)
        self._is_stopped = False

    def set_period(self, period: float) -> None:
        """Be due at most one period, s, from now, and so on; if it is another one than before."""
        if period != self._period and not self._is_stopped:
            self._period = period
            self._timer.stop()
            self._timer = self._begin(period, True)

    def stop(self) -> None:
        """Never be due again."""
        self._is_stopped = True
        self._timer.stop()


class TimeHandle(HandleBase):
    """What a `NodeHandle` knows of time."""

    def __init__(self, process: "Process", name: str):
        super().__init__(process, name)
        self._clock: Publisher | None = None

    @property
    def uses_sim_time(self) -> bool:
        """Whether the node lives by simulated time (/use_sim_time)."""
        return self._process.uses_sim_time

    def time(self) -> float:
        """Return seconds for measuring intervals: simulated, or the machine's steady clock."""
        return self._process.clock.time()

    def stamp(self, moment: float | None = None) -> genpy.Time:
        """Return the ROS time of a moment of `time`, by default now."""
        return self._process.clock.stamp(moment)

    def nanoseconds(self, moment: float | None = None) -> int:
        """Return the same as `stamp` in whole ns, for a `StampedPose`."""
        return self._process.clock.nanoseconds(moment)

    def age(self, stamp: genpy.Time) -> float:
        """Return how long ago data was measured that has a stamp, s.

        However long that is: a stamp of another clock is no exception, since nothing tells it from
        that of a message that has waited. But 0 without a stamp (0), and for one ahead of now.
        """
        if not stamp:
            return 0.0
        return max(self.nanoseconds() - stamp.to_nsec(), 0) * 1e-9

    def timer(
        self,
        period: float,
        callback: Callable[[], None],
        steady: bool = False,
        is_spread: bool = False,
    ) -> Timer:
        """Have ``callback()`` called every ``period`` seconds of `time`.

        With ``steady`` the period is of the machine's clock also when time is
        simulated. Ticks that are missed are skipped. Those of short periods, up to 0.1 s, with
        which the nodes of a process begin are due together where their periods allow it. Those
        with ``is_spread`` are not, so that many nodes do not all report at the same moment; their
        first tick may be one period late.
        """
        timer = self._process.add_timer(period, self._tick(callback), steady, is_spread)
        self._undo.append(timer.stop)
        return timer

    def _deliver_latest(self):
        for deliver in self._to_deliver:
            deliver()

    def _tick(self, callback):
        guarded = self.guard(callback)

        def tick():
            self._deliver_latest()
            guarded()

        return tick

    def varying_timer(self, period: float, callback: Callable[[], None]) -> VaryingTimer:
        """Do the same as `timer`; the period may be changed later.

        Then many of them with the same period are due at different moments, as with ``is_spread``.
        """
        tick = self._tick(callback)

        def begin(period: float, is_change: bool) -> Timer:
            return self._process.add_timer(
                period, tick, is_spread=is_change, may_be_early=is_change
            )

        timer = VaryingTimer(begin, period)
        self._undo.append(timer.stop)
        return timer

    def submit(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Have ``callback(*arguments)`` called in its turn with all other callbacks.

        This is how threads of a node's own hand over to it.
        """
        self._process.executor.submit(partial(self.guard(callback), *arguments))

    def clock_publisher(self) -> Callable[..., None]:
        """Return ``set_clock(*moments)``, which moves simulated time to moments (s) for everybody.

        Other processes are told of all of them, in one go. In this process time moves to the last
        one, after the present callback; then the timers that are due run.
        """
        publisher = self._process.topics.publisher("/clock", Clock, latch=False)
        self._clock = publisher

        def set_clock(*moments: float) -> None:
            stamp = self.stamp(moments[-1])
            self._process.transport.clock_was_set(stamp)
            passed = moments[:-1] if publisher.is_heard_outside() else ()
            publisher.publish(Clock(stamp), [Clock(self.stamp(each)) for each in passed])

        return set_clock

    def next_event(self) -> float:
        """Return the next moment, s, at which simulated time has to stop.

        That is when a timer of this process is due; or at once, where somebody in it listens to
        the clock.
        """
        # One listener is the process itself.
        if self._clock is None or self._clock.is_read_here(beside=1):
            return -math.inf
        return self._process.next_simulated_deadline()

    def announce_flights(self) -> Callable[[bool], None]:
        """Return ``tell(in_flight)``, which tells every process of flights that this node ends.

        Processes with nodes that are needed in flight do not end at SIGINT before it.
        """
        announcement = self._process.announce_flights(self._name)
        self._undo.append(announcement.close)
        return announcement.tell
