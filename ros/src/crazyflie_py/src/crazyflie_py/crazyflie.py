"""The vehicles as Crazyswarm's scripts see them: each vehicle, and all of them.

Names, arguments and defaults are Crazyswarm's, and crazyswarm2's where only that has the method.
Angles are in rad unless a method says otherwise,
lengths in m, times in s.
"""

import contextlib
import functools
import logging
import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from uav_trajectory import Trajectory

from crazyflie_mission_api.mission_vehicle import (
    AttitudeSetpoint,
    FullStateSetpoint,
    HoverSetpoint,
    MotorsOffSetpoint,
    Move,
    Playback,
    PositionSetpoint,
    Setpoint,
    VelocityWorldSetpoint,
)
from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_model.collision_avoidance import AvoidanceSettings
from crazyflie_model.lights import COLOR_LED_DECKS, wrgb
from crazyflie_model.limits import MAX_YAW_RATE
from crazyflie_py import arguments as check
from crazyflie_py.swarm import DEFAULT_COLOR, Order, Swarm, SwarmVehicle, TimeHelper

_log = logging.getLogger(__name__)

__all__ = ["Crazyflie", "CrazyflieServer", "TimeHelper"]

Array = NDArray[np.float64]

#: Largest yaw rate of `Crazyflie.cmdHover` (rad/s). A larger one is taken for one in degrees/s.
_MAX_YAW_RATE = 2.0 * MAX_YAW_RATE


class ScriptCommands:
    """Checks arguments and sends commands to a vehicle, by default to all."""

    def __init__(self, swarm: Swarm, vehicle: SwarmVehicle | None = None):
        self._swarm = swarm
        self._vehicle = vehicle
        self._vehicles = swarm.vehicles if vehicle is None else [vehicle]
        self._name = "allcfs" if vehicle is None else vehicle.name  # In messages.

    def _command(self, name: str, *arguments: Any, **facts: Any) -> None:
        self._swarm.command(Order(name, arguments, **facts), self._vehicle)

    def _send(self, setpoint: Setpoint) -> None:
        for vehicle in self._vehicles:
            vehicle.send(setpoint)

    def _where(self, method: str) -> str:
        return f"{self._name}.{method}"

    def _mask(self, method: str, mask: int) -> int:
        where = self._where(method)
        mask = check.byte(where, "groupMask", mask)
        groups = functools.reduce(operator.or_, (vehicle.groups for vehicle in self._vehicles))
        # A script may name any groups of one vehicle.
        if mask and self._vehicle is None and not mask & groups:
            _log.warning(
                "%s: groupMask is %d, and setGroupMask has put no vehicle into these groups; all "
                "vehicles ignore the command",
                where,
                mask,
            )
        return mask

    def takeoff(self, targetHeight: float, duration: float, groupMask: int = 0) -> None:
        """Fly straight up to a height (z in the world frame, m) in a duration (s).

        It returns at once. A mask is 0, or the groups of the command; see `Crazyflie.setGroupMask`.
        """
        self._climb("takeoff", targetHeight, duration, groupMask, flies=True)

    def land(self, targetHeight: float, duration: float, groupMask: int = 0) -> None:
        """Fly straight down to a height and stop the motors there; see `takeoff`."""
        self._climb("land", targetHeight, duration, groupMask, flies=False)

    def _climb(self, name, height, duration, mask, flies):
        where = self._where(name)
        height = check.number(where, "targetHeight", height)
        seconds = check.number(where, "duration", duration, 0.0)
        self._command(
            name,
            height,
            seconds,
            group_mask=self._mask(name, mask),
            flies=flies,
            goal=(np.nan, np.nan, height) if flies else None,
            duration=seconds,
        )

    def stop(self, groupMask: int = 0) -> None:
        """Stop the motors: after a landing, as a vehicle in the air falls."""
        self._command("stop", group_mask=self._mask("stop", groupMask))

    def _go_to(self, goal, yaw, duration, relative, mask):
        where = self._where("goTo")
        place, turn = check.triple(where, "goal", goal), check.number(where, "yaw", yaw)
        seconds = check.number(where, "duration", duration, 0.0)
        mask = self._mask("goTo", mask)
        turn = self._vehicles[0].checked_yaw(turn)
        move = Move(place, turn, seconds, bool(relative))
        goal = None if relative else place
        self._command("go_to", move, group_mask=mask, flies=True, goal=goal)

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
        mask = self._mask("startTrajectory", groupMask)
        flight = Playback(
            check.byte(where, "trajectoryId", trajectoryId),
            check.number(where, "timescale", timescale, 1e-3, 1e3),
            bool(reverse),
            bool(relative),
        )
        self._command("start_trajectory", flight, group_mask=mask, flies=True)

    def notifySetpointsStop(self, remainValidMillisecs: int = 100, groupMask: int = 0) -> None:
        """Return from setpoints (cmd...) to commands such as `land`.

        The last setpoint remains valid for a time (ms). For masks see `Crazyflie.setGroupMask`.
        """
        where = self._where("notifySetpointsStop")
        remain = check.integer(where, "remainValidMillisecs", remainValidMillisecs, 0, 2**31 - 1)
        mask = self._mask("notifySetpointsStop", groupMask)
        self._command("notify_setpoints_stop", remain, group_mask=mask)

    def emergency(self) -> None:
        """Stop the motors at once; commands have no effect until a restart."""
        self._command("emergency")

    def arm(self, arm: bool = True) -> None:
        """Arm, or disarm."""
        self._command("arm", bool(arm))

    def setParam(self, name: str, value: float) -> None:
        """Set a firmware parameter, GROUP/NAME or GROUP.NAME."""
        self._set_parameters(check.parameters(self._where("setParam"), {name: value}))

    def _set_parameters(self, values: Mapping[str, float]) -> None:
        for vehicle in self._vehicles:
            vehicle.parameters.update(values)

    def cmdFullState(
        self, pos: ArrayLike, vel: ArrayLike, acc: ArrayLike, yaw: float, omega: ArrayLike
    ) -> None:
        """Send a setpoint: position, velocity, acceleration, yaw, body rates (rad/s)."""
        where = self._where("cmdFullState")
        position, velocity = check.triple(where, "pos", pos), check.triple(where, "vel", vel)
        acceleration = check.triple(where, "acc", acc)
        heading, rates = check.number(where, "yaw", yaw), check.triple(where, "omega", omega)
        self._send(FullStateSetpoint(position, velocity, acceleration, heading, rates))


class Crazyflie(ScriptCommands):
    """One vehicle."""

    _vehicle: SwarmVehicle

    def __init__(self, swarm: Swarm, vehicle: SwarmVehicle):
        super().__init__(swarm, vehicle)
        self.id = vehicle.config.id  #: Last byte of its radio address.
        #: name, prefix: "cf1", "/cf1".
        self.name = vehicle.name
        self.prefix = f"/{vehicle.name}"
        #: Start point in the fleet file (m).
        self.initialPosition: Array = np.array(vehicle.config.position)
        #: Colour that `setLEDColor` has set; initially, Crazyswarm's colour in pictures.
        self.ledRGB = DEFAULT_COLOR

    def setGroupMask(self, groupMask: int) -> None:
        """Make the vehicle a member of up to 8 groups, a bit each.

        A command with a mask other than 0 concerns vehicles that have a bit in common with it.
        """
        mask = check.byte(self._where("setGroupMask"), "groupMask", groupMask)
        self._vehicle.set_group_mask(mask)

    def goTo(
        self,
        goal: ArrayLike,
        yaw: float,
        duration: float,
        relative: bool = False,
        groupMask: int = 0,
    ) -> None:
        """Fly smoothly to a position and yaw and stay there; returns at once.

        With ``relative`` both are added to the presently planned ones.
        """
        self._go_to(goal, yaw, duration, relative, groupMask)

    def uploadTrajectory(self, trajectoryId: int, pieceOffset: int, trajectory: Trajectory) -> None:
        """Write a trajectory into the vehicle's memory, under a number for `startTrajectory`.

        The offset is the number of pieces of other trajectories before it in the memory, which has
        room for 31.
        """
        where = self._where("uploadTrajectory")
        number = check.byte(where, "trajectoryId", trajectoryId)
        offset = check.byte(where, "pieceOffset", pieceOffset)
        pieces = [
            replace(piece, yaw=[*map(self._vehicle.checked_yaw, piece.yaw)])
            for piece in check.pieces(where, trajectory)
        ]
        self._command("upload_trajectory", number, offset, pieces)

    # State.

    def position(self) -> Array:
        """Return the position, m, shape (3,)."""
        return np.array(self._vehicle.state().position)

    def velocity(self) -> Array:
        """Return the velocity, m/s, shape (3,)."""
        return np.array(self._vehicle.state().velocity)

    def acceleration(self) -> Array:
        """Return the acceleration, m/s^2, shape (3,)."""
        return np.array(self._vehicle.state().acceleration)

    def rpy(self) -> tuple[float, float, float]:
        """Return roll, pitch and yaw, rad; a positive pitch accelerates forward."""
        return self._vehicle.state().rpy

    def yaw(self) -> float:
        """Return the yaw, rad."""
        return self._vehicle.state().rpy[2]

    def get_position(self) -> list[float]:
        """Return the position, m."""
        return list(self._vehicle.state().position)

    def get_pose(self) -> dict[str, Any]:
        """Return "position" (x, y, z) and "orientation" (x, y, z, w), with these attributes."""
        state = self._vehicle.state()
        point = SimpleNamespace(**dict(zip("xyz", state.position, strict=True)))
        quaternion = quaternion_from_rpy(*state.rpy)
        orientation = SimpleNamespace(**dict(zip("xyzw", quaternion, strict=True)))
        return {"position": point, "orientation": orientation}

    def get_status(self) -> dict[str, Any]:
        """Return battery voltage, supervisor bits and others, with crazyswarm2's keys."""
        return self._vehicle.status()

    # Parameters.

    def getParam(self, name: str) -> float:
        """Return a firmware parameter, GROUP/NAME or GROUP.NAME."""
        key = check.parameter_name(self._where("getParam"), name)
        return self._vehicle.parameters[key]

    def setParams(self, params: Mapping[str, float]) -> None:
        """Set firmware parameters, name -> value."""
        self._set_parameters(check.parameters(self._where("setParams"), params))

    def setLEDColor(self, r: float, g: float, b: float) -> None:
        """Set the colour, 0 to 1 each, of the LED ring and of Color LED decks.

        The ring's parameter ring/effect must be 7.
        """
        where = self._where("setLEDColor")
        colors = {"solidRed": ("r", r), "solidGreen": ("g", g), "solidBlue": ("b", b)}
        levels = {
            f"ring.{name}": int(255.0 * check.number(where, *color, 0.0, 1.0))
            for name, color in colors.items()
        }
        for deck, name in COLOR_LED_DECKS.items():
            # Older firmware knows no such deck.
            with contextlib.suppress(ValueError):
                levels |= {name: wrgb(r, g, b)} if self._vehicle.parameters[deck] else {}
        self._set_parameters(levels)
        self.ledRGB = (r, g, b)

    # Setpoints. The firmware levels out 0.5 s after the last one and stops the motors after 2 s.

    def cmdPosition(self, pos: ArrayLike, yaw: float = 0.0) -> None:
        """Send a setpoint: position and yaw."""
        where = self._where("cmdPosition")
        position, heading = check.triple(where, "pos", pos), check.number(where, "yaw", yaw)
        self._send(PositionSetpoint(position, heading))

    def cmdVelocityWorld(self, vel: ArrayLike, yawRate: float) -> None:
        """Send a setpoint: velocity in the world frame, yaw rate (deg/s, counter-clockwise)."""
        where = self._where("cmdVelocityWorld")
        velocity = check.triple(where, "vel", vel)
        self._send(VelocityWorldSetpoint(velocity, check.number(where, "yawRate", yawRate)))

    def cmdHover(self, vx: float, vy: float, yaw_rate: float, z_distance: float) -> None:
        """Send a setpoint: velocity ahead and to the left, yaw rate (rad/s), height."""
        forward, left, height = self._numbers(
            "cmdHover", {"vx": vx, "vy": vy, "z_distance": z_distance}
        )
        limits = -_MAX_YAW_RATE, _MAX_YAW_RATE
        rate = check.number(self._where("cmdHover"), "yaw_rate", yaw_rate, *limits)
        self._send(HoverSetpoint(forward, left, math.degrees(rate), height))

    def cmdVel(self, roll: float, pitch: float, yawrate: float, thrust: float) -> None:
        """Send a setpoint: roll, pitch (deg), yaw rate (deg/s), thrust (PWM, 0 to 65535)."""
        arguments = {"roll": roll, "pitch": pitch, "yawrate": yawrate, "thrust": thrust}
        self._send(AttitudeSetpoint(*self._numbers("cmdVel", arguments)))

    def cmdStop(self) -> None:
        """Send a setpoint that stops the motors."""
        self._send(MotorsOffSetpoint())

    def _numbers(self, method, arguments):
        where = self._where(method)
        return [check.number(where, name, value) for name, value in arguments.items()]

    # Collision avoidance.

    def enableCollisionAvoidance(
        self,
        others: Sequence["Crazyflie"],
        ellipsoidRadii: ArrayLike,
        bboxMin: Sequence[float] = (-np.inf,) * 3,
        bboxMax: Sequence[float] = (np.inf,) * 3,
        horizonSecs: float = 1.0,
        maxSpeed: float = 2.0,
        sidestepThreshold: float = 0.25,
        voronoiProjectionTolerance: float = 1e-5,
        voronoiProjectionMaxIters: int = 100,
    ) -> None:
        """Avoid collisions by buffered Voronoi cells, on board.

        Parameters
        ----------
        others : sequence of Crazyflie
            Vehicles that are avoided with --sim; with hardware all others on the same channel are
            avoided.
        ellipsoidRadii : array_like, shape (3,)
            Semi-axes of the ellipsoid that is kept free, m.
        bboxMin, bboxMax : sequence of float, 3 each
            Corners of the box that the vehicle stays in, m.
        horizonSecs, maxSpeed : float
            s, m/s.
        sidestepThreshold : float
            Distance from the wall of the cell at which a sidestep begins, m.
        voronoiProjectionTolerance, voronoiProjectionMaxIters
            See `crazyflie_model.collision_avoidance.AvoidanceSettings`.
        """
        where = self._where("enableCollisionAvoidance")
        iterations = voronoiProjectionMaxIters
        settings = AvoidanceSettings(
            check.triple(where, "ellipsoidRadii", ellipsoidRadii, 1e-3),
            check.corner(where, "bboxMin", bboxMin),
            check.corner(where, "bboxMax", bboxMax),
            check.number(where, "horizonSecs", horizonSecs, 1e-3),
            check.number(where, "maxSpeed", maxSpeed, 0.0),
            check.number(where, "sidestepThreshold", sidestepThreshold, 0.0),
            check.number(where, "voronoiProjectionTolerance", voronoiProjectionTolerance, 0.0),
            check.integer(where, "voronoiProjectionMaxIters", iterations, 1, 10**6),
        )
        found = check.instances(where, "others", others, Crazyflie)
        vehicles = [other._vehicle for other in found if other is not self]
        self._vehicle.avoid(vehicles, settings)

    def disableCollisionAvoidance(self) -> None:
        """End collision avoidance."""
        self._vehicle.avoid((), None)


class _Found(dict[Any, Crazyflie]):
    """Vehicles by a key; the error about an unknown key names the known ones."""

    def __missing__(self, key: object) -> Crazyflie:
        raise KeyError(
            f"no vehicle has the key {key!r}; expected one of {', '.join(map(str, self))}"
        )


class CrazyflieServer(ScriptCommands):
    """All vehicles; its commands are broadcast to all at the same moment."""

    def __init__(self, swarm: Swarm):
        super().__init__(swarm)
        #: In the order of the fleet file.
        self.crazyflies = [Crazyflie(swarm, vehicle) for vehicle in swarm.vehicles]
        swarm.crazyflies = self.crazyflies
        self.crazyfliesById = _Found({cf.id: cf for cf in self.crazyflies})
        self.crazyfliesByName = _Found({cf.name: cf for cf in self.crazyflies})

    def goTo(self, goal: ArrayLike, yaw: float, duration: float, groupMask: int = 0) -> None:
        """Fly by an offset (m) and an angle (rad); see `Crazyflie.goTo`."""
        self._go_to(goal, yaw, duration, True, groupMask)
