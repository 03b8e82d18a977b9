"""References of a high-level commander: hover, straight moves, trajectories."""

import math
from typing import NamedTuple

from crazyflie_model.angles import Triple, rotate_by_yaw
from crazyflie_model.planner import (
    MAX_ACCELERATION,
    MAX_SPEED,
    move,
    shortest_duration,
)
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_model.trajectory import Pieces, Trajectory
from crazyflie_utils.refusal import RefusalError

#: Largest distance of the vehicle from the present goal at which a move begins at the goal (m);
#: otherwise it begins at the vehicle's position, since another node has moved it.
NEAR = 0.5


_MAX_STEP = 0.1  #: Longest time after a velocity setpoint for which the goal continues to move (s).


class Velocity(NamedTuple):
    """A setpoint without a position."""

    velocity: Triple  # In the fixed frame; with a height forward, to the left and up (m/s).
    yaw_rate: float = 0.0  # Counter-clockwise (rad/s).
    height: float | None = None  # Height above the ground (m).


class CommandFollower:
    """The goal of one vehicle, by time.

    Commands are those of the firmware's high-level commander, and so are trajectories from rest.
    Invalid commands raise `RefusalError`.
    """

    def __init__(self) -> None:
        self._uploads: dict[int, Pieces] = {}
        #: The present command's trajectory, from its beginning; None without one.
        self.trajectory: Trajectory | None = None
        self.is_move = False  #: Whether it is a move, which may be interrupted.
        self.setpoint: Goal[float] | None = None  #: The last setpoint; None after a command.
        self.start_time = 0.0  #: Time of the command or setpoint (s).

    def forget(self) -> None:
        """Delete the goal; uploaded trajectories stay."""
        self.trajectory = self.setpoint = None
        self.is_move = False

    def take_setpoint(self, time: float, goal: Goal[float]) -> None:
        """Replace any command by the goal of a setpoint."""
        self.forget()
        self.setpoint, self.start_time = goal, time

    def take_velocity(
        self, time: float, measured: Goal[float], setpoint: Velocity, ground: float
    ) -> None:
        """Replace any command by a goal that moves at a velocity from the present goal.

        ``ground`` is the height (z) of the ground, above which the setpoint's height is given, m.
        """
        start, age = self._start(time, measured), time - self.start_time
        passed = 0.0 if self.setpoint is None else min(max(age, 0.0), _MAX_STEP)
        x, y, z = (p + v * passed for p, v in zip(start.position, start.velocity, strict=True))
        yaw = start.yaw + start.yaw_rate * passed
        vx, vy, vz = setpoint.velocity
        if setpoint.height is not None:
            z = ground + setpoint.height
            vx, vy = rotate_by_yaw(vx, vy, yaw)
        goal = Goal((x, y, z), (vx, vy, vz), (0.0,) * 3, yaw, setpoint.yaw_rate)
        self.take_setpoint(time, goal)

    def delay(self, duration: float) -> None:
        """Continue a move, which has been interrupted for a duration (s)."""
        self.start_time += duration

    def restart_move(self, time: float, position: Triple) -> None:
        """Begin the rest of a move at ``time`` (s) at rest at a position (m)."""
        assert self.trajectory is not None
        end = self.trajectory.evaluate(self.trajectory.duration)
        start = at_rest(position, self.trajectory.evaluate(time - self.start_time).yaw)
        left = self.start_time + self.trajectory.duration - time
        duration = max(left, shortest_duration(math.dist(position, end.position), 0.0))
        self._move(time, start, end.position, end.yaw, duration)

    def is_moving(self, time: float) -> bool:
        """Return whether a move or a trajectory has not ended."""
        return self.trajectory is not None and time < self.start_time + self.trajectory.duration

    def goal(self, time: float) -> Goal[float] | None:
        """Return the goal at ``time`` (s), at rest after the end; None before any command."""
        if self.trajectory is None:
            return self.setpoint
        return self.trajectory.evaluate(time - self.start_time)

    def go_to(
        self,
        time: float,
        measured: Goal[float],
        position: Triple,
        yaw: float | None,
        duration: float,
        relative: bool = False,
        is_limited: bool = False,
    ) -> None:
        """Fly to a position (m) and heading (rad), or by them, in ``duration`` (s).

        It begins with the position, velocity and acceleration of the present goal; with those of
        ``measured``, which is where the vehicle is, when that is further away than `NEAR`. Without
        a yaw it keeps the heading. If ``is_limited``, too short a duration is refused; see
        `crazyflie_model.planner`.
        """
        _check(*position, yaw or 0.0)
        if not (math.isfinite(duration) and duration > 0.0):
            raise RefusalError(f"the duration is {duration:g} s; expected more than 0 s")
        start = self._start(time, measured)
        if relative:
            x, y, z = start.position
            position = (x + position[0], y + position[1], z + position[2])
        if yaw is None:
            yaw = start.yaw
        elif relative:
            yaw += start.yaw
        distance = math.dist(start.position, position)
        needed = shortest_duration(distance, math.hypot(*start.velocity))
        if is_limited and duration < needed:
            raise RefusalError(
                f"{distance:.2f} m in {duration:g} s; expected a duration of at least "
                f"{needed:.2f} s (at most {MAX_SPEED:g} m/s and {MAX_ACCELERATION:g} m/s^2)"
            )
        self._move(time, start, position, yaw, duration)

    def upload(self, number: int, pieces: Pieces) -> None:
        """Store a trajectory under a number."""
        if not pieces:
            raise RefusalError("the trajectory has no pieces")
        for piece in pieces:
            _check(*(c for axis in piece.axes for c in axis))
            if not piece.duration > 0.0:
                raise RefusalError(f"a piece lasts {piece.duration:g} s; expected more than 0 s")
        self._uploads[number] = tuple(pieces)

    def start(
        self,
        time: float,
        measured: Goal[float],
        number: int,
        timescale: float = 1.0,
        backwards: bool = False,
        relative: bool = False,
    ) -> None:
        """Fly a trajectory; ``relative``: as if it began at the present goal."""
        if number not in self._uploads:
            raise RefusalError(f"no trajectory {number} was uploaded")
        if not (math.isfinite(timescale) and timescale > 0.0):
            raise RefusalError(f"the timescale is {timescale:g}; expected more than 0")
        trajectory = Trajectory(tuple(self._uploads[number]), timescale, backwards)
        if relative:
            trajectory = trajectory.moved_to(self._start(time, measured).position, None)
        self._fly(time, trajectory)

    def _start(self, time, measured):
        present = self.goal(time)
        if present is None or math.dist(present.position, measured.position) > NEAR:
            return measured
        return present

    def _move(self, time, start, position, yaw, duration):
        self._fly(time, Trajectory(move(start, position, yaw, duration)))
        self.is_move = True

    def _fly(self, time, trajectory):
        self.forget()
        self.trajectory, self.start_time = trajectory, time


def _check(*numbers):
    for number in numbers:
        if not math.isfinite(number):
            raise RefusalError(f"one of the numbers is {number:g}; expected finite ones")
