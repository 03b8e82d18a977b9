"""A high-level command, as a service asks for it."""

from collections.abc import Callable
from dataclasses import dataclass

from crazyflie_link.high_level import ALL_GROUPS, HighLevel

TAKEOFF, LAND, STOP = "takeoff", "land", "stop"
"""Commands that are not as all others, which move a vehicle in the air."""


@dataclass(frozen=True)
class Command:
    """A high-level command: ``send(high_level)`` blocks until the vehicle has replied.

    The name is that of its service, the duration how long it is carried out, s.
    """

    name: str
    send: Callable[[HighLevel], None]
    duration: float = 0.0
    group_mask: int = ALL_GROUPS

    @property
    def ends_flight(self) -> bool:
        """Whether the vehicle is on the ground afterwards, and it goes before all others."""
        return self.name in (LAND, STOP)
