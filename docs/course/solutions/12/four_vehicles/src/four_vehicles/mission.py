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
    half = SIDE / 2.0
    return [(x, y, HEIGHT) for x, y in ((half, -half), (half, half), (-half, half), (-half, -half))]


def mission(fleet: VehicleGroup) -> None:
    """Take off, form the square, go on to the next corner four times, land."""
    fleet.takeoff(HEIGHT)
    corners = square()
    places = fleet.formation(corners)
    first = {name: corners.index(tuple(place)) for name, place in places.items()}
    for turn in range(1, 5):
        fleet.go_to({name: corners[(k + turn) % 4] for name, k in first.items()})
    fleet.land()
