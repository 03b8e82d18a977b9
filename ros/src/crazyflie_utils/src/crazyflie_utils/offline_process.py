"""A process without ROS, whose clocks are set by hand: for tests, and for replays of journals."""

from collections.abc import Callable
from typing import Any

from typing_extensions import override

from crazyflie_utils.node import Node, Process
from crazyflie_utils.timers import Executor, SimulatedClock
from crazyflie_utils.topics import Transport

#: Period at which a timer of period 0 fires here (s); on a real machine it fires as often as
#: possible.
_SHORTEST_PERIOD = 1e-4


class WallClock(SimulatedClock):
    """Simulated time whose stamps are those of a wall clock that can be set."""

    def __init__(self) -> None:
        super().__init__()
        self.wall_offset = 0.0  #: Wall clock minus `time`, s.

    @override
    def nanoseconds(self, moment: float | None = None) -> int:
        return super().nanoseconds(moment) + round(self.wall_offset * 1e9)


class OfflineProcess(Process):
    """The real node handle, executor, timers and tf buffer with a given transport.

    ``clock`` is simulated time, and ``machine_clock`` that of the machine, for ``steady`` timers;
    both begin at ``start`` (s). Stamps are those of ``clock`` plus its ``wall_offset`` (s): a
    change of it is a step of the wall clock.
    """

    clock: WallClock

    def __init__(
        self,
        transport: Transport,
        start: float,
        recorder: Any = None,
        executor: Executor | None = None,
    ):
        self.machine_clock = SimulatedClock()
        self.machine_clock.set(start)
        super().__init__(transport, True, WallClock(), recorder, executor, self.machine_clock)
        self.clock.set(start)
        self.machine_clock.on_change(lambda now, _: self._steady.run_due(now))
        if recorder is not None:
            recorder.wall = lambda: round(self.clock.wall_offset * 1e9)
            recorder.look_period = 0
        self.set_clock: Callable[[float], None] = self._setter(0, self.clock)
        self.set_machine_clock: Callable[[float], None] = self._setter(1, self.machine_clock)
        self.executor.start()

    def initialize(self, node: Node, name: str) -> bool:
        """Initialize a node by its absolute name; return what ``node.initialize`` returned."""
        outcome: list[bool] = []

        def run():
            if self.recorder is not None:
                self.recorder.launch(node, name)
            outcome.append(node.initialize(self.handle(name)))

        # Queued as work: a latched message must wait until the node is complete.
        self.executor.submit(run)
        return outcome[0]

    def advance(self, duration: float) -> None:
        """Advance both clocks (s), with a stop at every timer's deadline."""
        pass_time(duration, self.clock.time, self.next_deadline, self.set_clocks)

    @override
    def machine_time(self) -> float:
        return self.machine_clock.time()

    def next_deadline(self) -> float:
        """Return the time at which the next timer of either clock is due, in simulated time (s)."""
        ahead = self.machine_clock.time() - self.clock.time()
        return min(self._simulated.next_deadline(), self._machine_deadline() - ahead)

    def set_clocks(self, moment: float) -> None:
        """Move both clocks, at once, until simulated time is ``moment`` (s)."""
        ahead = self.machine_clock.time() - self.clock.time()
        self.set_clock(moment)
        self.set_machine_clock(moment + ahead)

    def _machine_deadline(self) -> float:
        return self._steady.next_deadline()

    def _setter(self, number, clock):
        if self.recorder is None:
            return clock.set

        def set_recorded(moment):
            self.recorder.set_clock(number, moment)
            clock.set(moment)

        return set_recorded


def pass_time(
    duration: float,
    time: Callable[[], float],
    next_deadline: Callable[[], float],
    move_to: Callable[[float], None],
) -> None:
    """Advance ``time()`` by a duration (s), with a stop at each deadline."""
    end = time() + duration
    while time() < end:
        deadline = next_deadline()
        if deadline <= time():
            deadline = time() + _SHORTEST_PERIOD
        # A deadline may be past the end by a rounding error, which is not a step back.
        move_to(deadline if deadline < end + 1e-9 else end)
