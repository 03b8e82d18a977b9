"""Commands that the vehicle's own planner carries out."""

import copy
import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Self

from cflib.crazyflie.high_level_commander import HighLevelCommander
from cflib.crtp.crtpstack import CRTPPacket, CRTPPort

from crazyflie_link.broadcast import SharedCommand
from crazyflie_link.errors import AlreadyLandingError, NoReplyError, RefusedError, ValueRangeError
from crazyflie_link.link import Link
from crazyflie_link.subsystem import Subsystem, check_byte, check_duration, check_finite
from crazyflie_link.supervisor import read_state
from crazyflie_link.transmission import REPLY_LIMIT, RESEND_PERIOD, Request, Send
from crazyflie_model.supervisor import SupervisorState

ALL_GROUPS = 0  #: Group mask of commands to all vehicles.

_GO_TO_2_PROTOCOL = 8  #: First version of the protocol with linear go-to and spiral.

REPORT_LAG = 0.1  #: Time after which the supervisor, at 25 Hz, reports a takeoff, s.

_BUSY = 1  #: Reply to a takeoff while the planner flies, and to a landing while it lands.


@dataclass
class _Knowledge:
    """Trajectories and groups (bits, None if unknown), which cannot be read.

    ``defined`` ones have bytes of the memory; ``overwritten`` ones have the trajectory whose upload
    has overwritten them.
    """

    defined: dict[int, range] = field(default_factory=dict)
    overwritten: dict[int, int] = field(default_factory=dict)
    groups: int | None = None


class HighLevel(Subsystem):
    """High-level commands; each blocks until the vehicle has replied.

    All raise `CrazyflieError`: `RefusedError` with the vehicle's reason,
    `NoReplyError`, `LinkLostError`, or `ValueRangeError` before anything is sent. Durations and
    time scales are at least `crazyflie_link.subsystem.MIN_DURATION`.
    """

    def __init__(self, current_link: Callable[[], Link]):
        super().__init__(current_link)
        self._knowledge = _Knowledge()
        self._is_dry = False
        self._shared: SharedCommand | None = None

    def forget_trajectories(self) -> None:
        """Forget trajectories and groups: a vehicle that has restarted has none."""
        self._knowledge.defined.clear()
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
        self._command("the group mask", lambda c: c.set_group_mask(group_mask))
        self._knowledge.groups = group_mask

    def take_off(self, height: float, duration: float, group_mask: int = ALL_GROUPS) -> None:
        """Climb to a height (m) in a duration (s), keeping position and heading."""
        _check("takeoff", duration, group_mask, height)
        self._command(
            "the takeoff command", lambda c: c.takeoff(height, duration, group_mask, yaw=None)
        )

    def land(self, height: float, duration: float, group_mask: int = ALL_GROUPS) -> None:
        """Sink to a height (m) in a duration (s), keeping position and heading.

        The firmware also obeys on the ground, and starts the motors there. A vehicle that lands
        refuses it: `AlreadyLandingError`.
        """
        _check("landing", duration, group_mask, height)
        self._command(
            "the land command",
            lambda c: c.land(height, duration, group_mask, yaw=None),
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
        self._command("the land command", send, resend=duration > REPLY_LIMIT)

    def stop(self, group_mask: int = ALL_GROUPS) -> None:
        """Stop the motors, wherever the vehicle is."""
        check_byte("group mask", group_mask)
        self._command("the stop command", lambda c: c.stop(group_mask))

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
        self._command(
            "the go-to command",
            lambda c: c.go_to(
                x, y, z, yaw, duration, relative=relative, linear=linear, group_mask=group_mask
            ),
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
        self._command(
            "the spiral command",
            lambda c: c.spiral(
                angle, *radii, ascent, duration, is_sideways, is_clockwise, group_mask
            ),
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
        defined = self._knowledge.defined
        if trajectory_id not in defined:
            known = ", ".join(map(str, sorted(defined))) or "none"
            raise RefusedError(
                f"the start of the trajectory: {trajectory_id} has not been uploaded since the "
                f"vehicle was connected or restarted; known: {known}"
            )
        writer = self._knowledge.overwritten.get(trajectory_id)
        if writer is not None:
            raise RefusedError(
                f"the start of the trajectory: the upload of {writer} has overwritten "
                f"{trajectory_id} in the vehicle's memory; upload {trajectory_id} again"
            )
        self._command(
            "the start of the trajectory",
            lambda c: c.start_trajectory(
                trajectory_id,
                time_scale,
                relative_position=relative,
                reversed=is_reversed,
                group_mask=group_mask,
            ),
            resend=False,
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
        self._knowledge.overwritten.pop(trajectory_id, None)
        self._knowledge.defined[trajectory_id] = place

    def begin_upload(self, trajectory_id: int, place: range) -> None:
        """Mark the trajectories in these bytes of the memory as overwritten by another one."""
        known = self._knowledge
        for other, written in known.defined.items():
            if written.start < place.stop and place.start < written.stop:
                known.overwritten[other] = trajectory_id

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
