"""What a node handle needs of the process that its node is in."""

from collections.abc import Callable
from typing import Protocol

from crazyflie_utils.clock import SimulatedClock, SteadyClock
from crazyflie_utils.clock_source import ClockSource
from crazyflie_utils.executor import Executor
from crazyflie_utils.flights import ShutdownInhibitor
from crazyflie_utils.tf.transforms import Transforms
from crazyflie_utils.timers import Timer
from crazyflie_utils.topics import Topics
from crazyflie_utils.transport import Transport


class ProcessContext(Protocol):
    """What the nodes of a process share; `Process` is one."""

    @property
    def transport(self) -> Transport:
        """The graph outside the process."""

    @property
    def executor(self) -> Executor:
        """Runs all callbacks."""

    @property
    def clock(self) -> SimulatedClock | SteadyClock:
        """By which the process lives."""

    @property
    def topics(self) -> Topics:
        """All topics."""

    @property
    def transforms(self) -> Transforms:
        """Tf."""

    @property
    def uses_sim_time(self) -> bool:
        """Whether the clock is simulated time (/use_sim_time)."""

    def add_timer(
        self,
        period: float,
        work: Callable[[], None],
        steady: bool = False,
        stagger: bool = False,
        align_phase: bool = False,
    ) -> Timer:
        """Add a timer by the process's clock, or by the machine's if ``steady``."""

    @property
    def clock_source(self) -> ClockSource:
        """For the node that publishes /clock."""

    def inhibit_shutdown(self, node: str) -> ShutdownInhibitor:
        """Return what publishes the flights of a node, named absolutely."""

    def end(self, status: int) -> None:
        """Have the process shut down and exit with ``status``."""
