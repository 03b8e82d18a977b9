"""Commands of scripts with the same arguments for one vehicle and for all."""

import logging

from numpy.typing import ArrayLike

from crazyflie_py import arguments as check
from crazyflie_py.backend import Commands
from crazyflie_py.setpoints import FullState

_log = logging.getLogger(__name__)


class ScriptCommands:
    """Checks arguments and sends commands.

    Parameters
    ----------
    name : str
        In messages.
    commands : Commands
        Of the back-end.
    """

    def __init__(self, name: str, commands: Commands):
        self._name = name
        self._commands = commands

    def _where(self, method: str) -> str:
        return f"{self._name}.{method}"

    def _mask(self, where: str, mask: int) -> int:
        mask = check.byte(where, "groupMask", mask)
        if mask and not mask & self._groups():
            _log.warning(
                "%s: groupMask is %d, and no vehicle is in one of these groups by setGroupMask; "
                "they ignore the command",
                where,
                mask,
            )
        return mask

    def _groups(self) -> int:
        """Return all groups that any vehicle may be in."""
        return 0xFF

    def takeoff(self, targetHeight: float, duration: float, groupMask: int = 0) -> None:
        """Fly straight up to a height in a duration; returns at once.

        Parameters
        ----------
        targetHeight : float
            z in the world frame, m.
        duration : float
            s.
        groupMask : int
            0, or the groups that are meant; see `Crazyflie.setGroupMask`.
        """
        self._commands.take_off(*self._climb("takeoff", targetHeight, duration, groupMask))

    def land(self, targetHeight: float, duration: float, groupMask: int = 0) -> None:
        """Fly straight down to a height and stop the motors there; see `takeoff`."""
        self._commands.land(*self._climb("land", targetHeight, duration, groupMask))

    def _climb(self, method, height, duration, mask):
        where = self._where(method)
        return (
            check.number(where, "targetHeight", height),
            check.number(where, "duration", duration, 0.0),
            self._mask(where, mask),
        )

    def stop(self, groupMask: int = 0) -> None:
        """Stop the motors: after a landing, as a vehicle in the air falls."""
        self._commands.stop(self._mask(self._where("stop"), groupMask))

    def _go_to(self, goal, yaw, duration, relative, mask):
        where = self._where("goTo")
        self._commands.go_to(
            check.triple(where, "goal", goal),
            check.number(where, "yaw", yaw),
            check.number(where, "duration", duration, 0.0),
            bool(relative),
            self._mask(where, mask),
        )

    def startTrajectory(
        self,
        trajectoryId: int,
        timescale: float = 1.0,
        reverse: bool = False,
        relative: bool = True,
        groupMask: int = 0,
    ) -> None:
        """Fly along an uploaded trajectory; returns at once.

        Parameters
        ----------
        trajectoryId : int
            As at `Crazyflie.uploadTrajectory`.
        timescale : float
            2 takes twice as long.
        reverse : bool
            From its end to its beginning.
        relative : bool
            Shifted, so that it begins at the planned position.
        groupMask : int
            See `Crazyflie.setGroupMask`.
        """
        where = self._where("startTrajectory")
        self._commands.start_trajectory(
            check.byte(where, "trajectoryId", trajectoryId),
            check.number(where, "timescale", timescale, 1e-3, 1e3),
            bool(reverse),
            bool(relative),
            self._mask(where, groupMask),
        )

    def notifySetpointsStop(self, remainValidMillisecs: int = 100, groupMask: int = 0) -> None:
        """Return from setpoints (cmd...) to commands such as `land`.

        Parameters
        ----------
        remainValidMillisecs : int
            How long the last setpoint still counts, ms.
        groupMask : int
            See `Crazyflie.setGroupMask`.
        """
        where = self._where("notifySetpointsStop")
        remain = check.integer(where, "remainValidMillisecs", remainValidMillisecs, 0, 2**31 - 1)
        self._commands.notify_setpoints_stop(remain, self._mask(where, groupMask))

    def emergency(self) -> None:
        """Stop the motors at once; until a restart, nothing has an effect any more."""
        self._commands.emergency()

    def arm(self, arm: bool = True) -> None:
        """Arm, or disarm."""
        self._commands.arm(bool(arm))

    def setParam(self, name: str, value: float) -> None:
        """Set a firmware parameter, GROUP/NAME or GROUP.NAME."""
        self._commands.set_parameters(check.parameters(self._where("setParam"), {name: value}))

    def cmdFullState(
        self, pos: ArrayLike, vel: ArrayLike, acc: ArrayLike, yaw: float, omega: ArrayLike
    ) -> None:
        """Send a setpoint: position, velocity, acceleration, yaw, body rates (rad/s)."""
        where = self._where("cmdFullState")
        position, velocity = check.triple(where, "pos", pos), check.triple(where, "vel", vel)
        acceleration = check.triple(where, "acc", acc)
        heading, rates = check.number(where, "yaw", yaw), check.triple(where, "omega", omega)
        self._commands.send(FullState(position, velocity, acceleration, heading, rates))
