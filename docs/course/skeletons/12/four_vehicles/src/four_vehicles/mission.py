"""The mission: a square that turns."""

from crazyflie_mission_api import Bounds, Limits
from crazyflie_mission_api.vehicle_group import VehicleGroup

ROOM = Bounds((-2.0, -2.0, 0.0), (2.0, 2.0, 2.0))
LIMITS = Limits(speed=0.8, acceleration=1.5)

HEIGHT = 1.0
SIDE = 1.2
"""Side of the square (m)."""


def square() -> list[tuple[float, float, float]]:
    """Return the four corners of a square around the origin, counter-clockwise, m."""
    raise NotImplementedError("step 1")


def mission(fleet: VehicleGroup) -> None:
    """Take off, form the square, go on to the next corner four times, land."""
    raise NotImplementedError("step 2")
