"""Interfaces of a vehicle, and of its clock, for missions; commands and low-level setpoints."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, NamedTuple, Protocol

from crazyflie_mission_api.limits import Bounds
from crazyflie_model.angles import Triple, rotate_by_yaw
from crazyflie_model.trajectory import Pieces


class FullStateSetpoint(NamedTuple):
    """Position (m), velocity (m/s), acceleration (m/s^2), yaw (rad), body rates (rad/s)."""

    position: Triple
    velocity: Triple
    acceleration: Triple
    yaw: float
    omega: Triple


class PositionSetpoint(NamedTuple):
    """Position (m) and yaw (rad)."""

    position: Triple
    yaw: float


class VelocityWorldSetpoint(NamedTuple):
    """Velocity in the world frame (m/s) and yaw rate (deg/s, counter-clockwise)."""

    velocity: Triple
    yaw_rate: float


class HoverSetpoint(NamedTuple):
    """Velocity forward and to the left (m/s), yaw rate (deg/s, counter-clockwise), height (m)."""

    vx: float
    vy: float
    yaw_rate: float
    height: float


class AttitudeSetpoint(NamedTuple):
    """Roll right, pitch forward (deg), yaw rate (deg/s, counter-clockwise), thrust (PWM)."""

    roll: float
    pitch: float
    yaw_rate: float
    thrust: float


class MotorsOffSetpoint(NamedTuple):
    """Stops the motors; a later setpoint or command starts them again."""


Setpoint = (
    FullStateSetpoint
    | PositionSetpoint
    | VelocityWorldSetpoint
    | HoverSetpoint
    | AttitudeSetpoint
    | MotorsOffSetpoint
)


def led_to(setpoint: Setpoint, place: Triple, yaw: float, duration: float) -> Triple | None:
    """Return where a vehicle is after a duration (s) of a setpoint, from a place (m) and yaw (rad).

    None if that is not known.
    """
    x, y, z = place
    if isinstance(setpoint, FullStateSetpoint | PositionSetpoint):
        return setpoint.position
    if isinstance(setpoint, VelocityWorldSetpoint):
        vx, vy, vz = setpoint.velocity
        return x + vx * duration, y + vy * duration, z + vz * duration
    if isinstance(setpoint, HoverSetpoint):
        vx, vy = rotate_by_yaw(setpoint.vx, setpoint.vy, yaw)
        return x + vx * duration, y + vy * duration, setpoint.height
    return None


MEMORY = 31  #: Number of pieces that fit into the memory of a vehicle.


class Move(NamedTuple):
    """A smooth move to a point (m) and heading (rad), or by them from the plan (relative)."""

    goal: Triple
    yaw: float
    duration: float  # (s).
    relative: bool = False


class Playback(NamedTuple):
    """A flight along the uploaded trajectory of a number; relative: from the planned position."""

    number: int
    time_scale: float = 1.0
    reverse: bool = False
    relative: bool = False


class Commands(Protocol):
    """Commands to a vehicle, or to all vehicles of a swarm at the same moment.

    A command returns a future, which is done when it has been accepted, not when it has been
    carried out; its exception says why it was refused. A ``group_mask`` other than 0 restricts it
    to members of these groups.
    """

    def takeoff(self, height: float, duration: float, group_mask: int = 0) -> "Future[Any]":
        """Climb straight up to a height (m) in about a duration (s), keeping the heading."""

    def land(self, height: float | None, duration: float, group_mask: int = 0) -> "Future[Any]":
        """Sink straight down to a height (m), None is the ground, in about a duration (s)."""

    def stop(self, group_mask: int = 0) -> "Future[Any]":
        """Stop the motors of a vehicle that has landed, which the firmware keeps idling."""

    def go_to(self, move: Move, group_mask: int = 0) -> "Future[Any]":
        """Fly to a point."""

    def start_trajectory(self, flight: Playback, group_mask: int = 0) -> "Future[Any]":
        """Fly along an uploaded trajectory."""

    def notify_setpoints_stop(self, remain_valid_ms: int, group_mask: int = 0) -> "Future[Any]":
        """Return to high-level commands when the last setpoint is this old (ms)."""

    def emergency(self) -> "Future[Any]":
        """Stop the motors at once."""


class MissionVehicle(Commands, Protocol):
    """A vehicle of missions and of Crazyswarm's scripts."""

    name: str
    bounds: Bounds  #: Box of its fence.
    #: Largest delay of its start if several vehicles are called to `start` in a row (s).
    start_skew: float
    #: Part of a takeoff's duration that passes before the climb to the height begins (s).
    takeoff_lead: float = 0.0

    def position(self) -> Triple | None:
        """Return the position, m; None when it is not known."""

    def heading(self) -> float:
        """Return the heading, rad; 0 when it is not known, or cannot change."""

    def fault(self) -> str:
        """Return why the vehicle cannot fly on; empty if it can."""

    def has_landed(self) -> bool:
        """Return whether the vehicle is on the ground, with its motors off."""

    def prepare(self, pieces: Pieces, stream: bool) -> "Future[Any]":
        """Prepare a trajectory, to be uploaded as number 0 or streamed."""

    def start(self) -> "Future[Any]":
        """Fly the trajectory that was prepared last."""

    def upload_trajectory(
        self, trajectory_id: int, piece_offset: int, pieces: Pieces
    ) -> "Future[Any]":
        """Write pieces into the trajectory memory, from an offset on."""

    def set_group_mask(self, group_mask: int) -> "Future[Any]":
        """Make the vehicle a member of groups, a bit each."""

    def arm(self, arm: bool) -> "Future[Any]":
        """Arm or disarm."""

    def set_led_color(self, red: float, green: float, blue: float) -> "Future[Any]":
        """Light the lamps in a color, 0 to 1 each; without effect on a vehicle that has none."""

    def send(self, setpoint: Setpoint) -> None:
        """Send a low-level setpoint once; ValueError for one that the vehicle cannot follow."""


class Clock(Protocol):
    """The time of the vehicles."""

    def time(self) -> float:
        """Return the time, s."""

    def wait_until(self, condition: Callable[[], bool], deadline: float) -> bool:
        """Wait until ``condition()`` is true or it is ``deadline`` (s); return the condition.

        `MissionError`: time stands still, or ROS shuts down.
        """


def never() -> bool:
    """Return False: the condition of a wait for a time."""
    return False


def done(error: Exception | None) -> "Future[Any]":
    """Return a future that is done: with the result None, or an error."""
    future: Future[Any] = Future()
    if error is None:
        future.set_result(None)
    else:
        future.set_exception(error)
    return future
