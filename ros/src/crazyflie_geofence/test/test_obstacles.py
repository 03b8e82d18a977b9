"""Obstacles: the planes in front of them, and flights straight at them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_geofence import AXES, Flight, control_of

from crazyflie_geofence.geofence import Geofence
from crazyflie_geofence.obstacles import DOWNWASH, Obstacles, halfway, planes
from crazyflie_model.dynamics import coupled_acceleration
from crazyflie_world.shapes import Ball, Box, Cylinder

CLEARANCE = 0.1
PILLAR = Cylinder(name="pillar", centre=(1.0, 0.1, 1.0), radius=0.15, height=4.0)
TABLE = Box(name="table", centre=(1.2, 0.3, 0.4), extent=(0.8, 0.8, 0.8), yaw=0.3)
BALL = Ball(name="ball", centre=(0.9, 0.0, 1.4), radius=0.2)
ROOM = ((-3.0, -3.0, 0.3), (3.0, 3.0, 2.5))
UNIT = st.floats(-1.0, 1.0)


def is_touched(shape, position):
    """Return whether the vehicle's middle is nearer to a side than the clearance."""
    x, y, z = np.array(position) - shape.centre
    half = np.array(shape.size) / 2.0 + CLEARANCE
    if abs(z) >= half[2]:
        return False
    if isinstance(shape, Box):
        c, s = math.cos(shape.yaw), math.sin(shape.yaw)
        return abs(c * x + s * y) < half[0] and abs(c * y - s * x) < half[1]
    return math.hypot(x, y) < half[0]


@given(st.tuples(UNIT, UNIT, UNIT), st.sampled_from([PILLAR, TABLE, BALL]))
def test_a_point_in_front_of_a_plane_does_not_touch(unit, shape):
    position = tuple(c + 1.5 * u for c, u in zip(shape.centre, unit, strict=True))
    found = planes(shape, position, (0.0, 0.0, 0.0), CLEARANCE)
    is_free = any(plane.distance(position) >= 0.0 for plane in found)
    assert is_free != is_touched(shape, position)


class Among(Flight):
    """A flight in a room with obstacles."""

    def __init__(self, *shapes, **others):
        super().__init__(**others)
        self.fence = Geofence(*ROOM, AXES, obstacles=Obstacles(shapes, CLEARANCE))


@pytest.mark.parametrize("shape", [PILLAR, TABLE, BALL])
@pytest.mark.parametrize("beside", [0.0, 0.05, -0.1, 0.15, -0.2, 0.25])
def test_flown_straight_at_an_obstacle_it_does_not_touch_it(shape, beside):
    flight = Among(shape, position=(-1.5, shape.centre[1] + beside, shape.centre[2] + 0.1))

    def straight(t):
        to = np.array(shape.centre) - flight.position
        return control_of((2.0 * np.sign(to[0]), 2.0 * np.clip(to[1], -0.5, 0.5), 0.0), 0.0)

    path = flight.fly(straight, 8.0)
    assert not any(is_touched(shape, position) for position in path)
    nearest = min(
        max(
            plane.distance(position)
            for plane in planes(shape, position, (0.0, 0.0, 0.0), CLEARANCE)
        )
        for position in path
    )
    assert nearest < 0.1


def test_beside_an_obstacle_the_regular_control_passes():
    flight = Among(PILLAR, TABLE, position=(-1.5, 0.0, 1.0))
    regular = control_of((0.3, 0.1, 0.0), 0.0)
    control, priority = flight.fence.control(0.0, (-1.5, 0.0, 1.0), (0.0, 0.0, 0.0), 0.0, regular)
    assert (control, priority) == (regular, 0.0)


def test_it_slides_along_an_oblique_wall():
    wall = Box(name="wall", centre=(1.0, 0.0, 1.2), extent=(0.1, 8.0, 3.0), yaw=0.5)
    flight = Among(wall, position=(-0.5, 0.0, 1.4))
    path = flight.fly(lambda t: control_of((1.2, 0.0, 0.0), 0.0), 3.0)
    assert not any(is_touched(wall, position) for position in path)
    along = np.array([-math.sin(0.5), math.cos(0.5)])
    # The part of the acceleration along the wall is left: -1.2 sin(0.5).
    assert (path[-1, :2] - path[150, :2]) @ along < -1.0


VECTOR = st.tuples(UNIT, UNIT, UNIT)


@given(st.lists(st.tuples(VECTOR, st.integers(10, 150)), min_size=1, max_size=4))
def test_no_program_of_controls_touches_an_obstacle(program):
    flight = Among(PILLAR, draw=lambda: 1.0)
    for unit, periods in program:
        regular = control_of((1.8 * unit[0], 1.8 * unit[1], 2.0 * unit[2]), 0.0)
        path = flight.fly(lambda t, regular=regular: regular, periods * 0.01)
        assert not any(is_touched(PILLAR, position) for position in path)
        assert np.all(path > ROOM[0])
        assert np.all(path < ROOM[1])


def test_the_heading_does_not_matter():
    for yaw in (0.0, 1.0, math.pi):
        flight = Among(PILLAR, position=(0.55, 0.1, 1.0), yaw=yaw)
        control, priority = flight.fence.control(
            0.0, (0.55, 0.1, 1.0), (0.3, 0.0, 0.0), yaw, control_of((2.0, 0.0, 0.0), yaw)
        )
        assert priority == 1.0
        assert coupled_acceleration(control, yaw)[0] < 0.0


BUFFER = 0.15
PLACE = st.tuples(UNIT, UNIT, UNIT)


@given(PLACE, PLACE)
def test_both_vehicles_find_the_same_plane(a, b):
    mine, theirs = halfway(a, b, BUFFER), halfway(b, a, BUFFER)
    assert mine.distance(a) == pytest.approx(theirs.distance(b))
    # Where both are in front of their planes, their ellipsoids do not overlap.
    if mine.distance(a) >= 0.0:
        away = np.subtract(a, b) / (1.0, 1.0, DOWNWASH)
        assert np.linalg.norm(away) >= 2.0 * BUFFER - 1e-9


@pytest.mark.parametrize("draw", [0.0, 1.0, -1.0])
@pytest.mark.parametrize("beside", [0.0, 0.1])
@pytest.mark.parametrize("ahead", [2.0, 0.5])
def test_two_vehicles_that_fly_at_each_other_stay_apart(draw, beside, ahead):
    """At full tilt both ways, again and again; or one hovers (0.5 m/s^2)."""
    flights = [
        Among(position=(side, side * beside, 1.4), draw=lambda: draw) for side in (-1.2, 1.2)
    ]
    for flight in flights:
        flight.fence.buffer = BUFFER
    nearest = math.inf
    for k in range(600):
        places = [tuple(flight.position) for flight in flights]
        sign = 1.0 if k % 400 < 300 else -1.0
        for flight, other, u in zip(
            flights, places[::-1], (sign * 2.0, -sign * ahead), strict=True
        ):
            flight.fence.others = [other]
            flight.step(control_of((u, 0.0, 0.0), 0.0))
        nearest = min(nearest, math.dist(flights[0].position, flights[1].position))
    assert nearest > 2.0 * BUFFER
    # They came near: sideways, they slide past each other.
    assert draw or beside or nearest < 2.0 * BUFFER + 0.1
