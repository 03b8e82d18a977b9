"""Commands that the vehicle's own planner carries out."""

import os
from collections.abc import Callable, Sequence

from cflib.crazyflie.high_level_commander import HighLevelCommander
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_py.checks import check_byte, check_finite, check_positive
from crazyflie_py.errors import RefusedError
from crazyflie_py.exchange import Request
from crazyflie_py.link import Link
from crazyflie_py.subsystem import Subsystem

ALL_GROUPS = 0
"""Group mask that every vehicle obeys."""

# The first protocol versions with the present forms of two commands.
_GO_TO_2_PROTOCOL = 8
_START_2_PROTOCOL = 10


class HighLevel(Subsystem):
    """High-level commands; each blocks until the vehicle has replied.

    All raise `CrazyflieError`: `RefusedError` with the vehicle's reason,
    `NoReplyError`, `LinkLostError`, or `ValueRangeError` before anything is sent.
    """

    def __init__(self, current_link: Callable[[], Link]):
        super().__init__(current_link)
        self._defined: set[int] = set()

    def forget_trajectories(self) -> None:
        """Take note that the vehicle has restarted: it knows no trajectory any more."""
        self._defined = set()

    def set_group_mask(self, group_mask: int) -> None:
        """Set the groups (bits) that the vehicle belongs to."""
        check_byte("group mask", group_mask)
        self._command(
            "the group mask",
            HighLevelCommander.COMMAND_SET_GROUP_MASK,
            lambda c: c.set_group_mask(group_mask),
        )

    def take_off(self, height: float, duration: float, group_mask: int = ALL_GROUPS) -> None:
        """Climb to a height (m) in a duration (s), keeping position and heading."""
        check_finite("takeoff", height)
        check_positive("takeoff", duration)
        check_byte("group mask", group_mask)
        self._command(
            "the takeoff command",
            HighLevelCommander.COMMAND_TAKEOFF_2,
            lambda c: c.takeoff(height, duration, group_mask, yaw=None),
        )

    def land(self, height: float, duration: float, group_mask: int = ALL_GROUPS) -> None:
        """Sink to a height (m) in a duration (s), keeping position and heading."""
        check_finite("landing", height)
        check_positive("landing", duration)
        check_byte("group mask", group_mask)
        self._command(
            "the land command",
            HighLevelCommander.COMMAND_LAND_2,
            lambda c: c.land(height, duration, group_mask, yaw=None),
        )

    def stop(self, group_mask: int = ALL_GROUPS) -> None:
        """Stop the motors, wherever the vehicle is."""
        check_byte("group mask", group_mask)
        self._command(
            "the stop command",
            HighLevelCommander.COMMAND_STOP,
            lambda c: c.stop(group_mask),
        )

    def go_to(
        self,
        position: Sequence[float],
        yaw: float,
        duration: float,
        relative: bool = False,
        group_mask: int = ALL_GROUPS,
    ) -> None:
        """Fly to a position (x, y, z in m) and a yaw (rad) in a duration (s)."""
        x, y, z = position
        check_finite("go-to", x, y, z, yaw)
        check_positive("go-to", duration)
        check_byte("group mask", group_mask)
        is_new = self._current_link().protocol >= _GO_TO_2_PROTOCOL
        self._command(
            "the go-to command",
            HighLevelCommander.COMMAND_GO_TO_2 if is_new else HighLevelCommander.COMMAND_GO_TO,
            lambda c: c.go_to(x, y, z, yaw, duration, relative=relative, group_mask=group_mask),
            resend=not relative,
        )

    def start_trajectory(
        self,
        trajectory_id: int,
        time_scale: float = 1.0,
        relative: bool = False,
        is_reversed: bool = False,
        group_mask: int = ALL_GROUPS,
    ) -> None:
        """Fly a trajectory that was defined before.

        The firmware answers "done" for one that was not, and does nothing: therefore it is
        refused here.

        Parameters
        ----------
        trajectory_id : int
            0 to 255.
        time_scale : float
            2.0 takes twice as long.
        relative : bool
            Shift it so that it begins at the present setpoint.
        is_reversed : bool
            From its end to its beginning.
        group_mask : int
        """
        check_byte("trajectory number", trajectory_id)
        check_positive("time scale", time_scale)
        check_byte("group mask", group_mask)
        is_new = self._current_link().protocol >= _START_2_PROTOCOL
        if trajectory_id not in self._defined:
            known = ", ".join(map(str, sorted(self._defined))) or "none"
            raise RefusedError(
                f"the start of the trajectory: {trajectory_id} has not been uploaded since the "
                f"vehicle was connected or restarted; known: {known}"
            )
        self._command(
            "the start of the trajectory",
            HighLevelCommander.COMMAND_START_TRAJECTORY_2
            if is_new
            else HighLevelCommander.COMMAND_START_TRAJECTORY,
            lambda c: c.start_trajectory(
                trajectory_id,
                time_scale,
                relative_position=relative,
                reversed=is_reversed,
                group_mask=group_mask,
            ),
            resend=False,
        )

    def define_trajectory(self, trajectory_id: int, offset: int, pieces: int) -> None:
        """Define a trajectory: pieces in the trajectory memory, from an offset (bytes) on."""
        check_byte("trajectory number", trajectory_id)
        check_byte("number of pieces", pieces)
        self._command(
            "the definition of the trajectory",
            HighLevelCommander.COMMAND_DEFINE_TRAJECTORY,
            lambda c: c.define_trajectory(trajectory_id, offset, pieces),
        )
        self._defined.add(trajectory_id)

    def _command(self, what, number, send, resend=True):
        link = self._current_link()
        commander = link.cflib.high_level_commander
        request = Request(CRTPPort.SETPOINT_HL, 0, bytes([number]), what, resend)
        answer = link.ask(lambda: send(commander), request)
        # The first three bytes of the request, then the firmware's errno.
        code = answer[3] if len(answer) > 3 else 0
        if code:
            raise RefusedError(f"{what}: the vehicle refuses it ({os.strerror(code)}, {code})")
