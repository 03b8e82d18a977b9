"""High-level commands: their services, and their transmission to one vehicle."""

import enum
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from crazyflie_driver import srv
from crazyflie_link.broadcast import SharedCommand
from crazyflie_link.high_level import ALL_GROUPS, HighLevel

#: Commands that differ from the others, which move a vehicle in the air.
TAKEOFF, LAND, STOP = "takeoff", "land", "stop"

#: High-level command -> type of its service.
SERVICE_TYPES = {
    "takeoff": srv.Takeoff,
    "land": srv.Land,
    "stop": srv.Stop,
    "go_to": srv.GoTo,
    "start_trajectory": srv.StartTrajectory,
    "go_to_linear": srv.GoTo,
    "spiral": srv.Spiral,
}

#: High-level command -> function that sends a request of it.
_SENDERS: dict[str, Callable[[HighLevel, Any], None]] = {
    "takeoff": lambda high_level, r: high_level.take_off(
        r.height, r.duration.to_sec(), r.groupMask
    ),
    "land": lambda high_level, r: high_level.land(r.height, r.duration.to_sec(), r.groupMask),
    "stop": lambda high_level, r: high_level.stop(r.groupMask),
    "go_to": lambda high_level, r: high_level.go_to(
        (r.goal.x, r.goal.y, r.goal.z), r.yaw, r.duration.to_sec(), r.relative, r.groupMask
    ),
    "start_trajectory": lambda high_level, r: high_level.start_trajectory(
        r.trajectoryId, r.timescale, r.relative, r.reversed, r.groupMask
    ),
    "go_to_linear": lambda high_level, r: high_level.go_to(
        (r.goal.x, r.goal.y, r.goal.z),
        r.yaw,
        r.duration.to_sec(),
        r.relative,
        r.groupMask,
        linear=True,
    ),
    "spiral": lambda high_level, r: high_level.spiral(
        r.angle,
        (r.initialRadius, r.finalRadius),
        r.ascent,
        r.duration.to_sec(),
        r.sideways,
        r.clockwise,
        r.groupMask,
    ),
}


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
    sender = _SENDERS[name]
    return Command(
        name,
        lambda high_level: sender(high_level, request),
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
