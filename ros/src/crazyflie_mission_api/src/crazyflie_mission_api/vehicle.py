"""What a team needs of its vehicles and of time, whoever flies them."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Protocol

from crazyflie_mission_api.limits import Bounds
from crazyflie_mission_api.trajectories import Pieces
from crazyflie_model.angles import Triple


class Vehicle(Protocol):
    """A vehicle that takes high-level commands.

    A command returns a future, which is done when the vehicle has it, not when it has
    carried it out; its exception says why it was refused.
    """

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def bounds(self) -> Bounds:
        """The box that it is fenced in."""

    @property
    def start_skew(self) -> float:
        """How much later than others that are told to `start` in a row it may begin, s."""

    def position(self) -> Triple | None:
        """Return where it is, m; None when that is not known."""

    def heading(self) -> float:
        """Return its heading, rad; 0 when that is not known, or never another."""

    def trouble(self) -> str:
        """Return why it cannot fly on; an empty text when it can."""

    def has_landed(self) -> bool:
        """Return whether it stands, with its motors off."""

    def take_off(self, height: float, duration: float) -> "Future[Any]":
        """Climb straight up to a height (m) in a duration (s), more or less."""

    def land(self, duration: float) -> "Future[Any]":
        """Sink straight down to the ground in a duration (s), more or less."""

    def rest(self) -> None:
        """Be told that it has landed."""

    def go_to(self, goal: Triple, yaw: float, duration: float) -> "Future[Any]":
        """Fly to a point (m) and heading (rad) in a duration (s)."""

    def prepare(self, pieces: Pieces, stream: bool) -> "Future[Any]":
        """Take a trajectory, to be uploaded or streamed."""

    def start(self) -> "Future[Any]":
        """Fly the trajectory that was prepared last."""

    def emergency(self) -> "Future[Any]":
        """Stop the motors, wherever it is."""


class Clock(Protocol):
    """Time as the vehicles live by it."""

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
    """Return False: a condition that only time ends."""
    return False
