"""The objects that the nodes of one process share."""

import math
from collections.abc import Callable, Iterable
from functools import partial

from rosgraph_msgs.msg import Clock

from crazyflie_utils.flights import ShutdownInhibitor
from crazyflie_utils.log import NodeLog
from crazyflie_utils.tf.transforms import MAX_FUTURE_STAMP, MAX_FUTURE_STAMP_SIMULATED, Transforms
from crazyflie_utils.timers import (
    Executor,
    SimulatedClock,
    SteadyClock,
    SteadyTimers,
    Timer,
    TimerQueue,
)
from crazyflie_utils.topics import Publisher, Topics, Transport


class ProcessContext:
    """One executor, one clock, one set of topics and one tf buffer for all nodes of a process.

    With ``use_sim_time`` the clock is simulated time, which stands still until it is set; a test
    passes its own ``clock``.
    """

    def __init__(
        self, transport: Transport, use_sim_time: bool, clock: SimulatedClock | None = None
    ):
        self.transport = transport
        self.executor = Executor()
        transport.is_in_callback = lambda: self.executor.is_running_here
        self.topics = Topics(transport)
        self.clock: SimulatedClock | SteadyClock = clock or (
            SimulatedClock() if use_sim_time else SteadyClock()
        )
        self.transforms = Transforms(
            self.topics,
            self._warn_about_transform,
            self.clock.nanoseconds,
            MAX_FUTURE_STAMP_SIMULATED if use_sim_time else MAX_FUTURE_STAMP,
        )
        self._tf_log = NodeLog(transport, "/tf")
        # The poses of all vehicles that are simulated in one tick form one message.
        tf = self.transforms.gather, self.transforms.send_gathered
        self._steady = SteadyTimers(TimerQueue(self.executor, *tf), SteadyClock())
        self._simulated = TimerQueue(self.executor, *tf)
        self._clock_publisher: Publisher | None = None
        self._inhibitors: list[ShutdownInhibitor] = []
        #: Exit status with which the process is to end; None while it is not to end.
        self.exit_status: int | None = None
        #: Whether the process ends as soon as its flights have ended: none may begin.
        self.is_ending = False
        self.is_refused = False  #: Whether another process flies the vehicle of this one's nodes.
        if isinstance(self.clock, SimulatedClock):
            self.clock.on_change(self._run_simulated)
            self.topics.subscribe("/clock", Clock, partial(self._on_clock, self.clock))

    def end(self, status: int) -> None:
        """Shut the process down; it exits with ``status``."""
        self.exit_status = status

    @property
    def uses_sim_time(self) -> bool:
        """Whether the clock is simulated time (/use_sim_time)."""
        return isinstance(self.clock, SimulatedClock)

    def inhibit_shutdown(self, node: str) -> ShutdownInhibitor:
        """Return the publisher of the flights of a node, named absolutely."""
        inhibitor = ShutdownInhibitor(self.topics, node)
        self._inhibitors.append(inhibitor)
        return inhibitor

    @property
    def own_flights(self) -> list[str]:
        """Names of the nodes of this process that are in flight."""
        return [each.node for each in self._inhibitors if each.in_flight]

    def add_timer(
        self,
        period: float,
        work: Callable[[], None],
        steady: bool = False,
        stagger: bool = False,
        align_phase: bool = False,
    ) -> Timer:
        """Add a timer by the process's clock, or by the machine's if ``steady``.

        ValueError for a period that is negative or not finite; or zero by simulated time, where the
        moment would never end.
        """
        if self.uses_sim_time and not steady:
            if period == 0.0:
                raise ValueError("a timer by simulated time needs a period > 0")
            return self._simulated.add(period, work, self.clock.time(), stagger, align_phase)
        return self._steady.add(period, work, stagger, align_phase)

    def next_simulated_deadline(self) -> float:
        """Return when the next timer by simulated time is due, s."""
        return self._simulated.next_deadline()

    def clock_publisher(self) -> Callable[..., None]:
        """Return ``set_clock(moment, passed=())``, which moves simulated time to a moment (s).

        Other processes receive the moments ``passed`` meanwhile, too, all at once. In this process
        time moves after the present callback; then the due timers run.
        """
        publisher = self._clock_publisher = self.topics.publisher("/clock", Clock, latch=False)

        def set_clock(moment: float, passed: Iterable[float] = ()) -> None:
            stamp = self.clock.stamp(moment)
            self.transport.clock_was_set(stamp)
            heard = passed if publisher.is_heard_outside() else ()
            publisher.publish(_clock(stamp), [_clock(self.clock.stamp(each)) for each in heard])

        return set_clock

    def next_event(self) -> float:
        """Return the next moment, s, at which the publisher of simulated time must stop.

        That is when a timer of this process is due; or at once, if /clock has a subscriber in this
        process in addition to the process itself.
        """
        publisher = self._clock_publisher
        if publisher is None or publisher.is_read_here(excluding=1):
            return -math.inf
        return self.next_simulated_deadline()

    def _on_clock(self, clock, message):
        # Queued with all other work: time does not move within a callback, and a reset does not
        # overtake earlier messages of the simulation.
        self.executor.submit(clock.set, message.clock.to_sec())

    def _run_simulated(self, now, is_reset):
        if is_reset:
            self.transforms.clear()
            self._simulated.rebase(now)
        self._simulated.run_due(now)

    def _warn_about_transform(self, text, key):
        self._tf_log.warn(text, throttle=1.0, key=key)


def _clock(stamp):
    # The type's own constructor takes several times as long.
    message = object.__new__(Clock)
    message.clock = stamp
    return message
