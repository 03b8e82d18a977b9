"""The vehicle's own planner: its commands, and trajectories that are kept in its memory."""

import copy
import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Self

from cflib.crazyflie.high_level_commander import HighLevelCommander
from cflib.crazyflie.mem import CompressedSegment, CompressedStart, MemoryElement
from cflib.crtp.crtpstack import CRTPPacket, CRTPPort
from typing_extensions import override

from crazyflie_link.broadcast import SharedCommand
from crazyflie_link.errors import AlreadyLandingError, NoReplyError, RefusedError, ValueRangeError
from crazyflie_link.link import Link
from crazyflie_link.subsystem import (
    Subsystem,
    check_byte,
    check_duration,
    check_finite,
    check_positive,
    find_memory,
    write_memory,
)
from crazyflie_link.supervisor import read_state
from crazyflie_link.transmission import REPLY_LIMIT, RESEND_PERIOD, MaySend, Request, Send
from crazyflie_model.polynomials import COEFFICIENTS, PIECE_SIZE, PolynomialPiece
from crazyflie_model.supervisor import SupervisorState

ALL_GROUPS = 0  #: Group mask of commands to all vehicles.

_GO_TO_2_PROTOCOL = 8  #: First version of the protocol with linear go-to and spiral.

REPORT_LAG = 0.1  #: Time after which the supervisor, at 25 Hz, reports a takeoff, s.

_BUSY = 1  #: Reply to a takeoff while the planner flies, and to a landing while it lands.

#: Duration (s), and control points of x, y, z (m) and yaw (rad).
Segment = tuple[float, Sequence[float], Sequence[float], Sequence[float], Sequence[float]]

_POINTS = (0, 1, 3, 7)
_MOST_METRES, _MOST_RADIANS = 32.767, math.radians(3276.7)
_MOST_SECONDS = 65.535


@dataclass
class _Knowledge:
    """Trajectories and groups (bits, None if unknown), which cannot be read.

    A trajectory has bytes of the memory, and another one whose upload has overwritten them, if any.
    The planner may fly those that are in the bytes ``flown``, straight from there.
    """

    trajectories: dict[int, tuple[range, int | None]] = field(default_factory=dict)
    flown: tuple[range, ...] = ()
    groups: int | None = None


class HighLevel(Subsystem):
    """High-level commands; each blocks until the vehicle has replied.

    All raise `CrazyflieError`: `RefusedError` with the vehicle's reason,
    `NoReplyError`, `LinkLostError`, or `ValueRangeError` before anything is sent. Durations and
    time scales are at least `crazyflie_link.limits.MIN_DURATION`.
    """

    def __init__(self, current_link: Callable[[], Link]):
        super().__init__(current_link)
        self._knowledge = _Knowledge()
        self._asked_groups: int | None = None
        self._is_dry = False
        self._shared: SharedCommand | None = None

    def forget_trajectories(self) -> None:
        """Forget trajectories and groups: a vehicle that has restarted has none."""
        self._knowledge.trajectories.clear()
        self._knowledge.flown = ()
        self._knowledge.groups = 0

    def dry_run(self) -> Self:
        """Return an object that refuses the same commands, and sends nothing."""
        dry = copy.copy(self)
        dry._is_dry = True
        dry._knowledge = copy.deepcopy(self._knowledge)
        return dry

    def broadcast(self, shared: SharedCommand) -> Self:
        """Return an object whose next command is sent to several vehicles at once.

        A broadcast is not acknowledged, but every vehicle that has received it answers as it does
        to its own command. One that does not answer within 0.2 s is sent its own.
        """
        other = copy.copy(self)
        other._shared = shared
        return other

    def is_addressed(self, group_mask: int) -> bool | None:
        """Return whether the vehicle obeys commands to these groups; None if that is not known.

        The firmware answers "done" to those for others, and does nothing.
        """
        if group_mask == ALL_GROUPS:
            return True
        groups = self._knowledge.groups
        return None if groups is None else bool(group_mask & groups)

    def set_group_mask(self, group_mask: int) -> None:
        """Set the groups (bits) that the vehicle belongs to."""
        check_byte("group mask", group_mask)
        self._asked_groups = group_mask
        self._command("the group mask", lambda c: c.set_group_mask(group_mask))
        self._knowledge.groups = group_mask

    def restore_group_mask(self) -> None:
        """Set the groups again that were set last, if any: a vehicle that was off has none."""
        if self._asked_groups is not None:
            self.set_group_mask(self._asked_groups)

    def take_off(self, height: float, duration: float, group_mask: int = ALL_GROUPS) -> None:
        """Climb to a height (m) in a duration (s), keeping position and heading."""
        _check("takeoff", duration, group_mask, height)
        self._fly(
            "the takeoff command",
            lambda c: c.takeoff(height, duration, group_mask, yaw=None),
            group_mask,
        )

    def land(self, height: float, duration: float, group_mask: int = ALL_GROUPS) -> None:
        """Sink to a height (m) in a duration (s), keeping position and heading.

        The firmware also obeys on the ground, and starts the motors there. A vehicle that lands
        refuses it: `AlreadyLandingError`.
        """
        _check("landing", duration, group_mask, height)
        self._fly(
            "the land command",
            lambda c: c.land(height, duration, group_mask, yaw=None),
            group_mask,
            # After the touchdown a repetition would start the motors.
            resend=duration > REPLY_LIMIT,
        )

    def land_lower(self, height: float, duration: float) -> None:
        """Sink to a height (m) in a duration (s) instead of the landing that is under way.

        As a vehicle that lands refuses a landing, it is ended by a move of no length, in the packet
        before. If that is lost, the landing goes on: `AlreadyLandingError`.
        """
        _check("landing", duration, ALL_GROUPS, height)

        def send(commander):
            commander.go_to(0.0, 0.0, 0.0, 0.0, duration, relative=True)
            commander.land(height, duration, ALL_GROUPS, yaw=None)

        # After the touchdown a repetition would start the motors.
        self._fly("the land command", send, ALL_GROUPS, resend=duration > REPLY_LIMIT)

    def stop(self, group_mask: int = ALL_GROUPS) -> None:
        """Stop the motors, wherever the vehicle is."""
        check_byte("group mask", group_mask)
        self._fly("the stop command", lambda c: c.stop(group_mask), group_mask)

    def go_to(
        self,
        position: Sequence[float],
        yaw: float,
        duration: float,
        relative: bool = False,
        group_mask: int = ALL_GROUPS,
        linear: bool = False,
    ) -> None:
        """Fly to a position (x, y, z in m) and a yaw (rad) in a duration (s).

        A linear one has a constant velocity instead of a smooth beginning and end.
        """
        x, y, z = position
        _check("go-to", duration, group_mask, x, y, z, yaw)
        if linear and self._current_link().protocol < _GO_TO_2_PROTOCOL:
            raise RefusedError("the go-to command: this firmware has no linear one; update it")
        self._fly(
            "the go-to command",
            lambda c: c.go_to(
                x, y, z, yaw, duration, relative=relative, linear=linear, group_mask=group_mask
            ),
            group_mask,
            resend=not relative,
        )

    def spiral(
        self,
        angle: float,
        radii: tuple[float, float],
        ascent: float,
        duration: float,
        is_sideways: bool = False,
        is_clockwise: bool = False,
        group_mask: int = ALL_GROUPS,
    ) -> None:
        """Fly along a spiral of an angle (rad), between two radii (m), rising by ``ascent`` (m)."""
        _check("spiral", duration, group_mask, angle, *radii, ascent)
        if abs(angle) > 2.0 * math.pi:
            raise ValueRangeError(f"spiral: angle is {angle:g} rad; expected -2 pi to 2 pi")
        for radius in radii:
            if radius < 0.0:
                raise ValueRangeError(f"spiral: radius is {radius:g} m; expected at least 0")
        if self._current_link().protocol < _GO_TO_2_PROTOCOL:
            raise RefusedError("the spiral command: this firmware has none; update it")
        self._fly(
            "the spiral command",
            lambda c: c.spiral(
                angle, *radii, ascent, duration, is_sideways, is_clockwise, group_mask
            ),
            group_mask,
            resend=False,
        )

    def start_trajectory(
        self,
        trajectory_id: int,
        time_scale: float = 1.0,
        relative: bool = False,
        is_reversed: bool = False,
        group_mask: int = ALL_GROUPS,
    ) -> None:
        """Fly a trajectory that was defined before; a time scale of 2.0 takes twice as long.

        The firmware answers "done" for one that was not, and does nothing: therefore it is refused
        here. A relative one is shifted so that it begins at the present setpoint.
        """
        check_byte("trajectory number", trajectory_id)
        check_duration("time scale", time_scale)
        check_byte("group mask", group_mask)
        trajectories = self._knowledge.trajectories
        if (trajectory := trajectories.get(trajectory_id)) is None:
            known = ", ".join(map(str, sorted(trajectories))) or "none"
            raise RefusedError(
                f"the start of the trajectory: {trajectory_id} has not been uploaded since the "
                f"vehicle was connected or restarted; known: {known}"
            )
        place, writer = trajectory
        if writer is not None:
            raise RefusedError(
                f"the start of the trajectory: the upload of {writer} has overwritten "
                f"{trajectory_id} in the vehicle's memory; upload {trajectory_id} again"
            )
        self._fly(
            "the start of the trajectory",
            lambda c: c.start_trajectory(
                trajectory_id,
                time_scale,
                relative_position=relative,
                reversed=is_reversed,
                group_mask=group_mask,
            ),
            group_mask,
            resend=False,
            place=place,
        )

    def define_trajectory(
        self, trajectory_id: int, place: range, pieces: int, is_compressed: bool = False
    ) -> None:
        """Define a trajectory: pieces that are in these bytes of the trajectory memory."""
        check_byte("trajectory number", trajectory_id)
        check_byte("number of pieces", pieces)
        kind = HighLevelCommander.TRAJECTORY_TYPE_POLY4D
        if is_compressed:
            kind = HighLevelCommander.TRAJECTORY_TYPE_POLY4D_COMPRESSED
        self._command(
            "the definition of the trajectory",
            lambda c: c.define_trajectory(trajectory_id, place.start, pieces, kind),
        )
        self._knowledge.trajectories[trajectory_id] = place, None

    def begin_upload(self, trajectory_id: int, place: range) -> None:
        """Mark the trajectories in these bytes of the memory as overwritten by another one; blocks.

        Refused while the planner flies a trajectory that is there, or holds its end.
        """
        flown = [each for each in self._knowledge.flown if _overlap(each, place)]
        if flown and _may_plan(self._current_link()):
            raise RefusedError(
                f"the upload of trajectory {trajectory_id}: bytes {place.start} to {place.stop} of "
                f"the memory overlap {flown[0].start} to {flown[0].stop}, of the trajectory that "
                "the vehicle flies, or at whose end it is: upload to another place, or command "
                "go_to, land or stop before"
            )
        known = self._knowledge.trajectories
        for other, (written, _) in known.items():
            if _overlap(written, place):
                known[other] = written, trajectory_id

    def _fly(self, what, send, group_mask, resend=True, place=None):
        # A command that replaces the plan; by a trajectory if that has a place in the memory.
        knowledge, is_addressed = self._knowledge, self.is_addressed(group_mask)
        before = knowledge.flown
        if place is not None and is_addressed is not False:
            # Also if the reply is lost.
            knowledge.flown = (*before, place)
        try:
            self._command(what, send, resend)
        except RefusedError:
            knowledge.flown = before
            raise
        if is_addressed:
            knowledge.flown = () if place is None else (place,)

    def _command(self, what, send, resend=True):
        link = self._current_link()
        if self._is_dry:
            return
        packets = _packets(link, send)
        number, sent = packets[-1].data[0], 0

        def transmit():
            nonlocal sent
            sent += 1
            if self._shared is not None and sent == 1:
                self._shared.ready(packets[-1])
            else:
                for each in packets:
                    link.cflib.send_packet(each)

        request = Request(CRTPPort.SETPOINT_HL, 0, bytes([number]), what, resend)
        if self._shared is None or resend:
            answer = link.request(transmit, request)
        else:
            answer = request_after_broadcast(link, transmit, request)
        # The first three bytes of the request, then the firmware's errno.
        code = answer[3] if len(answer) > 3 else 0
        # A broadcast is repeated, too.
        is_repeated = sent > 1 or self._shared is not None
        if code and not (code == _BUSY and is_repeated and is_carried_out(link, number)):
            is_landing = code == _BUSY and number == HighLevelCommander.COMMAND_LAND_2
            error = AlreadyLandingError if is_landing else RefusedError
            raise error(f"{what}: the vehicle refuses it ({os.strerror(code)}, {code})")


def _overlap(one: range, other: range) -> bool:
    return one.start < other.stop and other.start < one.stop


def _may_plan(link: Link) -> bool:
    # Whether the planner may fly the vehicle; where its state is not reported it may.
    state = read_state(link)
    if state is None or not state.reports_planner:
        return True
    return SupervisorState.HIGH_LEVEL_ACTIVE in state


def _packets(link: Link, send: Callable[[HighLevelCommander], None]) -> list[CRTPPacket]:
    # Returns the packets that ``send(commander)`` has cflib send; the last one is the command.
    packets: list[CRTPPacket] = []
    recorder = SimpleNamespace(platform=link.cflib.platform, send_packet=packets.append)
    send(HighLevelCommander(recorder))
    return packets


def request_after_broadcast(link: Link, transmit: Send, request: Request) -> bytes:
    """Request what must not be done twice, first by a broadcast; see `Link.request`.

    The vehicle gets a command of its own only if the planner's last plan has ended, which it has
    not once this one is carried out.
    """
    try:
        return link.request(transmit, replace(request, limit=RESEND_PERIOD))
    except NoReplyError:
        state = read_state(link)
        if state is None or SupervisorState.TRAJECTORY_FINISHED not in state:
            raise
        return link.request(transmit, request)


def is_carried_out(link: Link, number: int) -> bool:
    """Return whether a repeated command (its number) was refused because the first is obeyed."""
    if number != HighLevelCommander.COMMAND_TAKEOFF_2:
        return number == HighLevelCommander.COMMAND_LAND_2
    end = time.monotonic() + REPORT_LAG
    while True:
        state = read_state(link)
        if state is None or not state.reports_planner:
            return True
        if SupervisorState.HIGH_LEVEL_ACTIVE in state or time.monotonic() > end:
            return SupervisorState.HIGH_LEVEL_ACTIVE in state
        time.sleep(REPORT_LAG / 4)


def _check(what: str, duration: float, group_mask: int, *values: float) -> None:
    check_finite(what, *values)
    check_duration(f"{what}: duration", duration)
    check_byte("group mask", group_mask)


class Trajectories(Subsystem):
    """The vehicle's memory of trajectories."""

    def __init__(self, current_link: Callable[[], Link], high_level: HighLevel):
        super().__init__(current_link)
        self._high_level = high_level

    @override
    def guarded(self, may_send: MaySend) -> Self:
        guarded = super().guarded(may_send)
        guarded._high_level = self._high_level.guarded(may_send)
        return guarded

    def upload(
        self,
        trajectory_id: int,
        piece_offset: int,
        pieces: Sequence[PolynomialPiece],
        check: Callable[[], None] = lambda: None,
    ) -> None:
        """Write pieces to the vehicle's memory and define a trajectory (0 to 255) of them; blocks.

        The offset in the memory is counted in pieces. ``check()`` is called before every packet,
        and ends the upload by raising. Raises `CrazyflieError` if the pieces do not fit, the
        vehicle refuses them or does not reply.
        """
        if not pieces:
            raise ValueRangeError(f"trajectory {trajectory_id} has no pieces")
        link = self._current_link()
        memory = find_memory(link, MemoryElement.TYPE_TRAJ, "trajectories")
        begin = piece_offset * PIECE_SIZE
        if begin + len(pieces) * PIECE_SIZE > memory.size:
            raise ValueRangeError(
                f"trajectory {trajectory_id}: {len(pieces)} pieces from piece {piece_offset} on "
                f"do not fit: the vehicle has room for {memory.size // PIECE_SIZE}"
            )
        data = b"".join(map(_packed, pieces))
        self._write(link, memory.id, trajectory_id, begin, data, len(pieces), check)

    def upload_compressed(
        self,
        trajectory_id: int,
        offset: int,
        start: Sequence[float],
        segments: Sequence[Segment],
        check: Callable[[], None] = lambda: None,
    ) -> None:
        """Write a compressed trajectory from a byte of the memory on, and define it; blocks.

        It begins at ``start`` (x, y, z in m, yaw in rad). A segment is its duration (s), and the
        control points of a Bezier curve for x, y, z and yaw without the first: 0, 1, 3 or 7.
        """
        if not segments:
            raise ValueRangeError(f"trajectory {trajectory_id} has no segments; expected one")
        link = self._current_link()
        memory = find_memory(link, MemoryElement.TYPE_TRAJ, "trajectories")
        data = bytes(_packed_start(start))
        for number, segment in enumerate(segments):
            data += _packed_segment(number, *segment)
        # The firmware flies segments until one has no duration.
        data += bytes(CompressedSegment(0.0, [], [], [], []).pack())
        if offset + len(data) > memory.size:
            raise ValueRangeError(
                f"trajectory {trajectory_id}: {len(data)} bytes from byte {offset} on do not fit; "
                f"the vehicle has {memory.size}"
            )
        count = min(len(segments), 255)
        self._write(link, memory.id, trajectory_id, offset, data, count, check, is_compressed=True)

    def _write(self, link, memory, trajectory_id, begin, data, count, check, is_compressed=False):
        place = range(begin, begin + len(data))
        self._high_level.begin_upload(trajectory_id, place)
        write_memory(link, memory, begin, data, "the trajectory", check)
        check()
        self._high_level.define_trajectory(trajectory_id, place, count, is_compressed)


def _packed(piece: PolynomialPiece) -> bytes:
    check_positive("duration of a piece", piece.duration)
    for name, coefficients in zip(("x", "y", "z", "yaw"), piece.axes, strict=True):
        if len(coefficients) > COEFFICIENTS:
            raise ValueRangeError(
                f"polynomial of {name} has {len(coefficients)} coefficients; expected at "
                f"most {COEFFICIENTS}"
            )
        check_finite(f"polynomial of {name}", *coefficients)
    return piece.pack()


def _packed_start(start: Sequence[float]) -> bytes:
    for name, value in zip(("x", "y", "z", "yaw"), start, strict=True):
        _check_points(f"start: {name}", name, [value])
    return bytes(CompressedStart(*start).pack())


def _packed_segment(number: int, duration: float, *axes: Sequence[float]) -> bytes:
    what = f"segment {number}"
    if not 0.001 <= duration <= _MOST_SECONDS:
        raise ValueRangeError(
            f"{what}: its duration is {duration:g} s; expected 0.001 to {_MOST_SECONDS:g} s"
        )
    for name, points in zip(("x", "y", "z", "yaw"), axes, strict=True):
        if len(points) not in _POINTS:
            raise ValueRangeError(
                f"{what}: {name} has {len(points)} control points; expected 0, 1, 3 or 7"
            )
        _check_points(f"{what}: {name}", name, points)
    return bytes(CompressedSegment(duration, *axes).pack())


def _check_points(what, name, points):
    most, unit = (_MOST_RADIANS, "rad") if name == "yaw" else (_MOST_METRES, "m")
    for value in points:
        # One that is not a number is refused as well.
        if not abs(value) <= most:
            raise ValueRangeError(f"{what} is {value:g} {unit}; expected at most +-{most:.6g}")
