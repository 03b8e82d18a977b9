"""What a group needs of its vehicles and of time: by ROS, or ideal."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Protocol

from crazyflie_mission_api.limits import Bounds
from crazyflie_model.angles import Triple
from crazyflie_model.trajectory import Pieces


class MissionVehicle(Protocol):
    """A vehicle that takes high-level commands.

    A command returns a future, which is done when the vehicle has accepted it, not when it has
    carried it out; its exception says why it was refused.
    """

    name: str
    bounds: Bounds  #: Its fence.
    #: How much later than others that are called to `start` in a row it may begin, s.
    start_skew: float

    def position(self) -> Triple | None:
        """Return the position, m; None when it is not known."""

    def heading(self) -> float:
        """Return the heading, rad; 0 when it is not known, or cannot change."""

    def fault(self) -> str:
        """Return why the vehicle cannot fly on; empty if it can."""

    def has_landed(self) -> bool:
        """Return whether the vehicle is on the ground, with its motors off."""

    def take_off(self, height: float, duration: float) -> "Future[Any]":
        """Climb straight up to a height (m) in about a duration (s)."""

    def land(self, duration: float) -> "Future[Any]":
        """Sink straight down to the ground in about a duration (s)."""

    def stop_motors(self) -> None:
        """Stop the motors of a vehicle that has landed: those of the firmware idle on."""

    def go_to(self, goal: Triple, yaw: float, duration: float) -> "Future[Any]":
        """Fly to a point (m) and heading (rad) in a duration (s)."""

    def prepare(self, pieces: Pieces, stream: bool) -> "Future[Any]":
        """Take a trajectory, to be uploaded or streamed."""

    def start(self) -> "Future[Any]":
        """Fly the trajectory that was prepared last."""

    def emergency(self) -> "Future[Any]":
        """Stop the motors at once."""


class Clock(Protocol):
    """The time of the vehicles."""

    def time(self) -> float:
        """Return the time, s."""

    def wait_until(self, condition: Callable[[], bool], deadline: float) -> bool:
        """Wait until ``condition()`` is true or it is ``deadline`` (s); return the condition.

        Raises
        ------
        MissionError
            Time stands still, or ROS shuts down.
        """


def never() -> bool:
    """Return False: the condition of a wait for a time."""
    return False
