"""High-level commands: their services, and their transmission to one vehicle."""

import enum
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from crazyflie_driver import srv
from crazyflie_link.broadcast import SharedCommand
from crazyflie_link.high_level import ALL_GROUPS, HighLevel

#: Commands that differ from the others, which move a vehicle in the air.
TAKEOFF, LAND, STOP = "takeoff", "land", "stop"


def _go_to(high_level, r, duration, linear=False):
    goal = (r.goal.x, r.goal.y, r.goal.z)
    high_level.go_to(goal, r.yaw, duration, r.relative, r.groupMask, linear)


def _spiral(high_level, r, duration):
    radii = (r.initialRadius, r.finalRadius)
    high_level.spiral(r.angle, radii, r.ascent, duration, r.sideways, r.clockwise, r.groupMask)


#: High-level command -> type of its service, and function that sends a request with a duration (s).
_COMMANDS: dict[str, tuple[Any, Callable[[HighLevel, Any, float], None]]] = {
    "takeoff": (srv.Takeoff, lambda h, r, duration: h.take_off(r.height, duration, r.groupMask)),
    "land": (srv.Land, lambda h, r, duration: h.land(r.height, duration, r.groupMask)),
    "stop": (srv.Stop, lambda h, r, _: h.stop(r.groupMask)),
    "go_to": (srv.GoTo, _go_to),
    "start_trajectory": (
        srv.StartTrajectory,
        lambda h, r, _: h.start_trajectory(
            r.trajectoryId, r.timescale, r.relative, r.reversed, r.groupMask
        ),
    ),
    "go_to_linear": (srv.GoTo, partial(_go_to, linear=True)),
    "spiral": (srv.Spiral, _spiral),
}

#: High-level command -> type of its service.
SERVICE_TYPES = {name: service_type for name, (service_type, _) in _COMMANDS.items()}


@dataclass(frozen=True)
class Command:
    """A high-level command: ``send(high_level)`` blocks until the vehicle has replied.

    The name is that of its service, the duration that of the motion, s. A landing has a height (m),
    unless it only goes on with the one under way.
    """

    name: str
    send: Callable[[HighLevel], None]
    duration: float = 0.0
    group_mask: int = ALL_GROUPS
    height: float | None = None

    def by(self, shared: SharedCommand | None) -> "Command":
        """Return the command, sent with those to other vehicles; with None the same command."""
        if shared is None:
            return self
        return replace(self, send=lambda high_level: self.send(high_level.broadcast(shared)))

    @property
    def ends_flight(self) -> bool:
        """Whether the vehicle is on the ground afterwards, and it goes before all others."""
        return self.name in (LAND, STOP)


def requested(name: str, request: Any) -> Command:
    """Return the command that a service with this name is asked for."""
    duration = request.duration.to_sec() if hasattr(request, "duration") else 0.0
    _, send = _COMMANDS[name]
    return Command(
        name,
        lambda high_level: send(high_level, request, duration),
        duration,
        request.groupMask,
        request.height if name == LAND else None,
    )


class Need(enum.Enum):
    """Packets that a vehicle needs for a command."""

    COMMAND = enum.auto()
    SETPOINTS_STOP = enum.auto()  #: The notice that setpoints stop, right before the command.
    #: No packet: a landing would start the motors of a vehicle on the ground.
    ON_GROUND = enum.auto()
    NOT_ADDRESSED = enum.auto()  #: No packet: the command is for other groups.
