"""The clock of scripts."""

from collections.abc import Sequence

from crazyflie_py import arguments as check
from crazyflie_py.backend import SwarmBackend, Visualizer


class TimeHelper:
    """The clock: of the simulation with --sim, otherwise ROS's.

    Attributes
    ----------
    dt : float
        Period of the simulation's steps, s; 0 without --sim.
    visualizer : Visualizer
        What --sim draws with; without --sim it does nothing.
    crazyflies : sequence of Crazyflie
    """

    def __init__(self, backend: SwarmBackend, crazyflies: Sequence[object]):
        self._backend = backend
        self.visualizer: Visualizer = backend.visualizer
        self.crazyflies = crazyflies

    @property
    def dt(self) -> float:
        """Period of the simulation's steps, s."""
        return self._backend.dt

    def time(self) -> float:
        """Return the time, s."""
        return self._backend.time()

    def sleep(self, duration: float) -> None:
        """Wait for a duration, s."""
        self._backend.sleep(check.number("timeHelper.sleep", "duration", duration))

    def sleepForRate(self, rateHz: float) -> None:
        """Wait, so that the calls of a loop are 1/rateHz apart."""
        rate = check.number("timeHelper.sleepForRate", "rateHz", rateHz, 1e-3, 1e5)
        self._backend.sleep_for_rate(rate)

    def isShutdown(self) -> bool:
        """Return whether the script should end, as after Ctrl-C."""
        return self._backend.is_shutdown()

    def nextPhase(self) -> None:
        """Begin the next file of --writecsv."""
        self._backend.next_phase()
