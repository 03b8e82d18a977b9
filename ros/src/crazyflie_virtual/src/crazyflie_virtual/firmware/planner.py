"""The high-level commander: takeoff, landing, go to, trajectories.

Clients may upload trajectories in a compressed form, in which each axis of a segment is a Bezier
curve of degree 0, 1, 3 or 7: see "Trajectory formats" in the firmware's documentation.
"""

import errno
import math
import struct
from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import Any

from crazyflie_model.planner import smooth_piece, spiral_piece, straight_piece
from crazyflie_model.polynomials import PIECE_SIZE, Goal, PolynomialPiece, at_rest, bezier
from crazyflie_model.trajectory import Trajectory, moved, turned
from crazyflie_virtual.firmware.states import ABSOLUTE, MOTION, Estimate, Modes, Setpoint

_START = struct.Struct("<4h")
_HEADER = struct.Struct("<BH")

_POINTS = (0, 1, 3, 7)  #: Control points that are stored for each type of curve: all but the first.

_MILLI = 1e-3
_TENTH_DEGREE = math.pi / 1800.0
_UNITS = (_MILLI, _MILLI, _MILLI, _TENTH_DEGREE)  #: Units of x, y, z (m) and yaw (rad).


def read_compressed(memory: bytes) -> tuple[PolynomialPiece, ...]:
    """Return the pieces of a compressed trajectory; ValueError without a start point.

    The memory begins with the start point, 4 numbers of 16 bits: x, y, z in mm and yaw in tenths of
    a degree. Then segments: a byte with two bits for each axis' type of curve, x lowest; the
    duration in ms, 16 bits; the control points of x, of y, of z and of yaw. The first control point
    is the previous segment's last one and is omitted. The trajectory ends with a segment of no
    duration, or with the memory. At least one piece is returned: without segments, one of no
    duration at the start point.
    """
    if len(memory) < _START.size:
        raise ValueError("a compressed trajectory begins with 8 bytes")
    ends = [unit * n for unit, n in zip(_UNITS, _START.unpack_from(memory), strict=True)]
    pieces = []
    at = _START.size
    while at + _HEADER.size <= len(memory):
        types, milliseconds = _HEADER.unpack_from(memory, at)
        at += _HEADER.size
        counts = [_POINTS[types >> 2 * axis & 3] for axis in range(4)]
        if milliseconds == 0 or at + 2 * sum(counts) > len(memory):
            break
        duration = _MILLI * milliseconds
        axes = []
        for axis, count in enumerate(counts):
            numbers = struct.unpack_from(f"<{count}h", memory, at)
            at += 2 * count
            points = [ends[axis], *(_UNITS[axis] * n for n in numbers)]
            axes.append(bezier(points, duration))
            ends[axis] = points[-1]
        pieces.append(PolynomialPiece(duration, *axes))
    return tuple(pieces) or (PolynomialPiece(0.0, *((end,) for end in ends)),)


def read_polynomials(memory: bytes) -> tuple[PolynomialPiece, ...]:
    """Return the pieces of a trajectory that fills the memory; ValueError if one is impossible."""
    begins = range(0, len(memory), PIECE_SIZE)
    return tuple(PolynomialPiece.unpack(memory[begin:][:PIECE_SIZE]) for begin in begins)


def _planned(pieces, time_scale, backwards):
    if time_scale > 0.0:
        return Trajectory(pieces, time_scale, backwards)
    end = Trajectory(pieces, 1.0, backwards).evaluate(math.inf)
    return Trajectory((PolynomialPiece(0.0, *((part,) for part in (*end.position, end.yaw))),))


MEMORY_SIZE = 4096  #: Bytes of the trajectory memory.
DEFINITIONS = 31  #: Trajectories that can be defined at one time.
IN_MEMORY = 1  #: Location of trajectories: in the memory.
POLYNOMIALS, COMPRESSED = 0, 1  #: Types of trajectories.
REFUSED = 1  #: Error number of a command that the state does not permit.
_MIN_DURATION = 0.01  #: Shortest duration of a plan (s).
#: Result of the firmware's arithmetic for a plan with infinite numbers.
_NOT_A_NUMBER = PolynomialPiece(1.0, *[(math.nan,)] * 4)
_MIN_SPEED = 0.001  #: Lower limit of the speed of a climb (m/s): clients may set 0.

_TRACKING = Modes(x=ABSOLUTE, y=ABSOLUTE, z=ABSOLUTE, yaw=ABSOLUTE)


class TrajectoryState(Enum):
    """States of the planner; names as the firmware's TRAJECTORY_STATE."""

    IDLE = 0  #: The planner keeps the motors off.
    FLYING = 1
    LANDING = 2
    DISABLED = 3  #: No setpoints: a command contained a number that is not finite.


ACTIVE = (TrajectoryState.FLYING, TrajectoryState.LANDING)  #: States with setpoints.


class Planner:
    """Plans trajectories and evaluates them; ``write_line(text)`` prints on the console.

    Commands return 0 or an error number. Their arguments are in the order of port 8.
    """

    def __init__(self, write_line: Callable[[str], None]):
        self._write_line = write_line
        self.memory = bytearray(MEMORY_SIZE)  #: Pieces of trajectories, uploaded by the client.
        self.state = TrajectoryState.IDLE
        self.blocked = False  #: Whether the vehicle cannot fly, and plans are refused.
        self.takeoff_speed = self.landing_speed = 0.5  #: Default of commands, m/s.
        self.groups = 0  #: Groups to which this vehicle belongs, a bit each.
        self._definitions: dict[int, tuple[int, int, int, int]] = {}
        self._trajectory: Trajectory | None = None
        # Where in the memory the trajectory is that is flown, what was read there, and how it is
        # planned; None for other plans.
        self._flown: tuple[slice, bytes, Callable[[bytes], Trajectory]] | None = None
        self._begin = 0.0
        self._last = at_rest((0.0, 0.0, 0.0))

    def is_finished(self, time: float) -> bool:
        """Return whether the last plan has ended."""
        return time >= self.end

    @property
    def end(self) -> float:
        """Time at which the last plan ends, s; minus infinity without."""
        return -math.inf if self._trajectory is None else self._begin + self._trajectory.duration

    def setpoint(self, time: float, estimate: Estimate) -> Setpoint | None:
        """Return the setpoint for ``time`` (s); None when disabled."""
        if self.state is TrajectoryState.LANDING and self.is_finished(time):
            self.state = TrajectoryState.IDLE
        if self._trajectory is None or self.state not in ACTIVE:
            self.tell_state(estimate)
            return Setpoint(time=time) if self.state is TrajectoryState.IDLE else None
        self._follow_memory()
        goal = self._trajectory.evaluate(time - self._begin)
        if not all(map(math.isfinite, goal.position)):
            self.state = TrajectoryState.DISABLED
            return None
        self._last = goal
        motion: tuple[Any, ...] = (*goal.position, *goal.velocity, *goal.acceleration)
        return Setpoint(
            **dict(zip(MOTION, motion, strict=True)),
            mode=_TRACKING,
            yaw=math.degrees(goal.yaw),
            yaw_rate=math.degrees(goal.yaw_rate),
            time=time,
        )

    def tell_state(self, estimate: Estimate) -> None:
        """Start the next plan at the estimated state instead of the last setpoint."""
        self._last = Goal(
            (estimate.x, estimate.y, estimate.z),
            (estimate.vx, estimate.vy, estimate.vz),
            (0.0,) * 3,
            math.radians(estimate.yaw),
            0.0,
        )

    def stop(self) -> int:
        """Keep the motors off."""
        self.state = TrajectoryState.IDLE
        return 0

    def block(self, is_blocked: bool) -> None:
        """Stop the plan and refuse further ones; or accept them again."""
        if is_blocked and self.state in ACTIVE:
            self.state = TrajectoryState.IDLE
        self.blocked = is_blocked

    def set_groups(self, groups: int) -> int:
        """Join the groups of a bit mask, and no others."""
        self.groups = groups
        return 0

    def take_off(
        self, time: float, height: float, yaw: float, keep_yaw: bool, duration: float
    ) -> int:
        """Climb to ``height`` (m) in ``duration`` (s), turning to ``yaw`` (rad) or keeping it."""
        if self.state is not TrajectoryState.IDLE:
            return REFUSED
        return self._move_vertically(time, height, yaw, keep_yaw, duration, TrajectoryState.FLYING)

    def take_off_at_speed(
        self, time: float, height: float, relative: bool, yaw: float, keep_yaw: bool, speed: float
    ) -> int:
        """Climb to, or by, ``height`` (m) at a mean speed (m/s), or that of the parameter."""
        climb = self._climb(height, relative, speed if speed > 0.0 else self.takeoff_speed)
        return self.take_off(time, climb[0], yaw, keep_yaw, climb[1])

    def land(self, time: float, height: float, yaw: float, keep_yaw: bool, duration: float) -> int:
        """Descend to ``height`` (m) in ``duration`` (s), then stop the motors."""
        if self.state is TrajectoryState.LANDING:
            return REFUSED
        return self._move_vertically(time, height, yaw, keep_yaw, duration, TrajectoryState.LANDING)

    def land_at_speed(
        self, time: float, height: float, relative: bool, yaw: float, keep_yaw: bool, speed: float
    ) -> int:
        """Descend to, or by, ``height`` (m) at a mean speed (m/s), or that of the parameter."""
        height = -height if relative else height
        climb = self._climb(height, relative, speed if speed > 0.0 else self.landing_speed)
        return self.land(time, climb[0], yaw, keep_yaw, climb[1])

    def _climb(self, height, is_relative, speed):
        # Height (m) and duration (s).
        now = self._last.position[2]
        height = now + height if is_relative else height
        return height, abs(height - now) / (_MIN_SPEED if abs(speed) < _MIN_SPEED else speed)

    def go_to(
        self,
        time: float,
        relative: bool,
        linear: bool,
        x: float,
        y: float,
        z: float,
        yaw: float,
        duration: float,
    ) -> int:
        """Fly to a position (m) and heading (rad), or by them, in ``duration`` (s)."""
        start = self._last
        if relative:
            x, y, z = x + start.position[0], y + start.position[1], z + start.position[2]
            yaw += start.yaw
        plan = straight_piece if linear else smooth_piece
        move = (start, (x, y, z), yaw, max(duration, _MIN_DURATION))
        return self._fly(time, TrajectoryState.FLYING, plan, *move)

    def spiral(
        self,
        time: float,
        sideways: bool,
        clockwise: bool,
        angle: float,
        first: float,
        last: float,
        ascent: float,
        duration: float,
    ) -> int:
        """Fly along a spiral; see `spiral_piece`. Radii are 0 at least, angles a turn at most."""
        # This order of arguments keeps NaN.
        angle = min(max(angle, -2.0 * math.pi), 2.0 * math.pi)
        radii = (max(first, 0.0), max(last, 0.0))
        form = (angle, radii, ascent, max(duration, _MIN_DURATION), sideways, clockwise)
        return self._fly(time, TrajectoryState.FLYING, spiral_piece, self._last, *form)

    def define(self, trajectory_id: int, location: int, kind: int, offset: int, pieces: int) -> int:
        """Define the place of a trajectory; it is checked only at its start.

        Only `IN_MEMORY`, and `POLYNOMIALS` or `COMPRESSED`, can be flown. The offset in the memory
        is in bytes; ``pieces`` is ignored for a compressed one.
        """
        if trajectory_id >= DEFINITIONS:
            return errno.ENOEXEC
        self._definitions[trajectory_id] = (location, kind, offset, pieces)
        return 0

    def start(
        self,
        time: float,
        relative: bool,
        relative_yaw: bool,
        backwards: bool,
        trajectory_id: int,
        time_scale: float,
    ) -> int:
        """Fly a trajectory that was defined; ``relative`` to the present position (and yaw).

        It is evaluated straight from the memory, also at its end: an upload there changes it.
        One that cannot be flown is ignored without an error. With a time scale that is not
        positive the trajectory ends at once.
        """
        try:
            place, read = self._place(trajectory_id)
            pieces = read(self.memory[place])
        except ValueError as error:
            self._write_line(f"HLC: no trajectory {trajectory_id}: {error}")
            return 0
        if not time_scale > 0.0:
            self._write_line(f"HLC: the trajectory ends at once: time scale {time_scale:g}")
        is_compressed = read is read_compressed
        if is_compressed and (time_scale != 1.0 or backwards):
            return errno.ENOEXEC
        start = _planned(pieces, time_scale, backwards).evaluate(0.0)
        pivot, turn, offset = start.position, 0.0, (0.0, 0.0, 0.0)
        if relative:
            if relative_yaw and not is_compressed:
                turn = math.remainder(self._last.yaw - start.yaw, 2.0 * math.pi)
            x, y, z = (a - b for a, b in zip(self._last.position, pivot, strict=True))
            offset = (x, y, z)

        def plan(data: bytes) -> Trajectory:
            there = _planned(read(data), time_scale, backwards)
            if not relative:
                return there
            return replace(there, pieces=moved(turned(there.pieces, pivot, turn), offset))

        data = bytes(self.memory[place])
        self._begin_at(time, plan(data), TrajectoryState.FLYING)
        self._flown = place, data, plan
        return 0

    def _follow_memory(self):
        if self._flown is None:
            return
        place, before, plan = self._flown
        data = bytes(self.memory[place])
        if data != before:
            try:
                self._trajectory = plan(data)
            except (ArithmeticError, ValueError):
                self._trajectory = Trajectory((_NOT_A_NUMBER,))
            self._flown = place, data, plan

    def _place(self, trajectory_id):
        # Where in the memory a trajectory is, and the function that reads its pieces there.
        if trajectory_id not in self._definitions:
            raise ValueError("it is not defined")
        location, kind, offset, count = self._definitions[trajectory_id]
        if location != IN_MEMORY or kind not in (POLYNOMIALS, COMPRESSED):
            raise ValueError(f"no trajectory has type {kind} and location {location}")
        if kind == COMPRESSED:
            return slice(offset, MEMORY_SIZE), read_compressed
        end = offset + count * PIECE_SIZE
        if not offset < end <= MEMORY_SIZE:
            raise ValueError(f"{count} pieces at byte {offset} are not in the memory")
        return slice(offset, end), read_polynomials

    def _move_vertically(self, time, height, yaw, keep_yaw, duration, state):
        x, y, z = self._last.position
        start = at_rest((x, y, z), self._last.yaw)
        move = (start, (x, y, height), start.yaw if keep_yaw else yaw)
        return self._fly(time, state, smooth_piece, *move, max(duration, _MIN_DURATION))

    def _fly(self, time, state, plan, *move):
        try:
            piece = plan(*move)
        except (ArithmeticError, ValueError):
            piece = _NOT_A_NUMBER
        self._begin_at(time, Trajectory((piece,)), state)
        return 0

    def _begin_at(self, time, trajectory, state):
        self._trajectory = trajectory
        self._flown = None
        self._begin = time
        self.state = state
