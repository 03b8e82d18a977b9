"""Where rays meet shapes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_world.shapes import Ball, Box, Circle, Cylinder, Wall, Waypoints, cast
from crazyflie_world.world import Floor, World

BOX = Box(name="box", centre=(2.0, 0.0, 1.0), extent=(1.0, 2.0, 0.5))
TURNED = Box(name="turned", centre=(2.0, 0.5, 1.0), extent=(1.0, 2.0, 0.5), yaw=0.7)
CYLINDER = Cylinder(name="cylinder", centre=(0.0, 2.0, 1.0), radius=0.5, height=1.0)
WALL = Wall(name="wall", start=(1, -1), end=(1, 1), height=2.0, thickness=0.2).box()
BALL = Ball(name="ball", centre=(-2.0, 0.0, 1.0), radius=0.5)

UNIT = st.floats(-1.0, 1.0)


def distance(shape, origin, direction):
    return float(cast((shape,), origin, direction)[0])


@pytest.mark.parametrize(
    ("shape", "origin", "direction", "expected"),
    [
        (BOX, (0, 0, 1), (1, 0, 0), 1.5),
        (BOX, (0, 0.99, 1), (1, 0, 0), 1.5),
        (BOX, (0, 1.01, 1), (1, 0, 0), math.inf),
        (BOX, (0, 0, 1), (-1, 0, 0), math.inf),
        (BOX, (2, 0, 3), (0, 0, -1), 1.75),
        (BOX, (2, 0, 1), (0, 0, -1), 0.0),
        (TURNED, (2, 0.5, 3), (0, 0, -1), 1.75),
        (CYLINDER, (0, 0, 1), (0, 1, 0), 1.5),
        (CYLINDER, (0.3, 0, 1), (0, 1, 0), 1.6),
        (CYLINDER, (0.6, 0, 1), (0, 1, 0), math.inf),
        (CYLINDER, (0, 2, 3), (0, 0, -1), 1.5),
        (CYLINDER, (0, 2.6, 3), (0, 0, -1), math.inf),
        (CYLINDER, (0, 0, 1.6), (0, 1, 0), math.inf),
        (BALL, (0, 0, 1), (-1, 0, 0), 1.5),
        (BALL, (0, 0.3, 1), (-1, 0, 0), 1.6),
        (BALL, (0, 0.6, 1), (-1, 0, 0), math.inf),
        (BALL, (-2, 0.1, 1), (0, 0, 1), 0.0),
        (WALL, (0, 0, 1), (1, 0, 0), 0.9),
        (WALL, (0, 0, 2.1), (1, 0, 0), math.inf),
        (Floor(size=(2.0, 2.0)).solid(), (0.5, 0, 1.5), (0, 0, -1), 1.5),
        (Floor(size=(2.0, 2.0)).solid(), (1.5, 0, 1.5), (0, 0, -1), math.inf),
        (Floor(size=(2.0, 2.0)).solid(), (0, 0, 1.5), (1, 0, 0), math.inf),
    ],
)
def test_distances(shape, origin, direction, expected):
    assert distance(shape, origin, direction) == pytest.approx(expected)


@given(st.tuples(UNIT, UNIT, UNIT), st.tuples(UNIT, UNIT, UNIT))
def test_where_a_ray_enters_is_the_surface(offset, origin):
    """Aimed at a point within, seen from outside: the entrance is on the surface."""
    for shape in (BOX, TURNED, CYLINDER, BALL):
        start = np.array(shape.centre) + 3.0 * np.array([*origin[:2], 1.0])
        aim = np.array(shape.centre) + 0.35 * np.array(offset) * np.array(shape.size)
        way = np.linalg.norm(aim - start)
        direction = (aim - start) / way
        met = distance(shape, start, direction)
        if not is_inside(shape, aim):
            continue
        assert 0.0 < met <= way + 1e-9
        assert is_inside(shape, start + (met + 1e-6) * direction)
        assert not is_inside(shape, start + (met - 1e-6) * direction)


def is_inside(shape, point):
    """Tell whether a point is in a shape, without rays."""
    x, y, z = np.array(point) - shape.centre
    if isinstance(shape, Ball):
        return math.hypot(x, y, z) < shape.radius
    if isinstance(shape, Cylinder):
        return math.hypot(x, y) < shape.radius and abs(z) < shape.height / 2.0
    c, s = math.cos(shape.yaw), math.sin(shape.yaw)
    own = (c * x + s * y, c * y - s * x, z)
    return all(abs(a) < size / 2.0 for a, size in zip(own, shape.size, strict=True))


def test_the_first_is_met():
    world = World(floor=Floor(size=(8.0, 8.0)), objects=(BOX, CYLINDER, BALL))
    directions = np.array([[[1, 0, 0], [0, 1, 0], [-1, 0, 0]], [[0, 0, -1], [0, 0, 1], [0, -1, 0]]])
    distances, indices = world.cast((0.0, 0.0, 1.0), directions)
    assert indices.tolist() == [[0, 1, 2], [3, -1, -1]]
    assert distances == pytest.approx(np.array([[1.5, 1.5, 1.5], [1.0, math.inf, math.inf]]))
    behind = Ball(name="behind", centre=(4.0, 0.0, 1.0), radius=1.4)
    for shapes in ((BOX, behind), (behind, BOX)):
        distances, indices = cast(shapes, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
        assert distances == pytest.approx(1.5)
        assert shapes[int(indices)] is BOX


def test_each_ray_has_an_origin_of_its_own():
    origins = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
    assert cast((BOX,), origins, (1.0, 0.0, 0.0))[0] == pytest.approx([1.5, 0.5])


def test_circle():
    circle = Circle(centre=(1.0, 2.0, 0.5), radius=0.5, period=8.0, phase=math.pi / 2.0)
    assert circle.position(0.0) == pytest.approx((1.0, 2.5, 0.5))
    assert circle.position(-3.0) == pytest.approx((1.0, 2.5, 0.5))
    assert circle.position(2.0) == pytest.approx((0.5, 2.0, 0.5))
    clockwise = replace(circle, clockwise=True)
    assert clockwise.position(2.0) == pytest.approx((1.5, 2.0, 0.5))


def test_waypoints():
    points = ((0.0, 0.0, 0.0, 1.0), (2.0, 1.0, 0.0, 1.0), (6.0, 0.0, 0.0, 1.0))
    path = Waypoints(points=points)
    places = [path.position(time)[0] for time in (-1.0, 0.0, 1.0, 2.0, 4.0, 6.0, 7.0)]
    assert places == pytest.approx([0.0, 0.0, 0.5, 1.0, 0.5, 0.0, 0.5])
    once = Waypoints(points=points[:2], repeat=False)
    assert once.position(99.0) == (1.0, 0.0, 1.0)


def test_what_moves_is_elsewhere_later():
    path = Circle(centre=(0.0, 0.0, 1.0), radius=1.0, period=4.0)
    moving = Ball(name="moving", centre=(1.0, 0.0, 1.0), radius=0.1, path=path)
    world = World(floor=Floor(size=(4.0, 4.0)), objects=(BOX, moving))
    assert world.moving == (moving,)
    later = world.at(1.0)
    assert later["moving"].centre == pytest.approx((0.0, 1.0, 1.0))
    assert later["box"] == BOX
    assert world.placed({"moving": (0.0, 0.0, 3.0)})["moving"].centre == (0.0, 0.0, 3.0)
    with pytest.raises(KeyError):
        world["nobody"]
