"""What a camera sees of a world's shapes: flat faces, plain or with a picture on them."""

import math
from dataclasses import dataclass, field, replace
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from crazyflie_world.shapes import Box, Colour, Cylinder, Shape
from crazyflie_world.world import Floor

Image = NDArray[np.uint8]  #: Rows, columns and, for colour, blue, green, red.
LIGHT = np.array([-0.36, 0.28, 0.89])  #: Where the light comes from, length 1.
AMBIENT = 0.6  #: Share of the brightness that a face has when no light falls on it.

CYLINDER_SIDES = 20

TILE = 0.5  #: Side of the checkers of a floor, m.

_TEXELS_PER_METRE = 80
_LARGEST_TEXTURE = 2048


@dataclass(frozen=True)
class Face:
    """A flat convex polygon that is seen from one side."""

    #: Shape (n, 3). Counter-clockwise as seen from outside, m, world frame.
    corners: NDArray[np.float64]
    colour: NDArray[np.float64]  #: Shape (3,). Blue, green, red, from 0 to 255.
    #: What is to be seen on it, if it has four corners: they are those at the lower left, lower
    #: right, upper right and upper left.
    texture: Image | None = None
    normal: NDArray[np.float64] = field(init=False)

    def __post_init__(self) -> None:
        a, b, c = self.corners[:3]
        cross = np.cross(b - a, c - b)
        object.__setattr__(self, "normal", cross / np.linalg.norm(cross))

    @property
    def shade(self) -> float:
        """Share of the colour's brightness."""
        return brightness(float(self.normal @ LIGHT))


def brightness(cosine: float) -> float:
    """Return the brightness of a surface from the cosine between its normal and the light."""
    return AMBIENT + (1.0 - AMBIENT) * max(cosine, 0.0)


def bgr(colour: Colour) -> NDArray[np.float64]:
    """Return a colour (red, green, blue from 0 to 1) as OpenCV has it."""
    return 255.0 * np.array(colour[::-1])


def faces_of(shape: Shape) -> list[Face]:
    """Return the faces of a box or a cylinder; of other shapes, none."""
    if isinstance(shape, Box):
        return _faces_of_box(shape)
    return _faces_of_cylinder(shape) if isinstance(shape, Cylinder) else []


def face_of(floor: Floor) -> Face:
    """Return the upper side of a floor."""
    x, y = (0.5 * length for length in floor.size)
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    texture = None if floor.texture == "plain" else _texture(floor)
    return Face(corners, bgr(floor.colour), texture)


@cache
def load_picture(path: str) -> Image:
    """Return the picture in a file.

    Raises
    ------
    OSError
        There is none, or it is none that OpenCV can read.
    """
    picture = cv2.imread(path, cv2.IMREAD_COLOR)
    if picture is None:
        raise OSError(f"{path} is no picture that can be read")
    return picture


#: Of a box: the direction out of each, and which one is up on it. The first is the front.
_SIDES = (
    ((1, 0, 0), (0, 0, 1)),
    ((-1, 0, 0), (0, 0, 1)),
    ((0, 1, 0), (0, 0, 1)),
    ((0, -1, 0), (0, 0, 1)),
    ((0, 0, 1), (0, 1, 0)),
    ((0, 0, -1), (0, 1, 0)),
)


def _faces_of_box(box):
    c, s = math.cos(box.yaw), math.sin(box.yaw)
    to_world = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    half = np.array(box.extent) / 2.0
    faces = []
    for normal, up in _SIDES:
        out, above, right = np.array(normal), np.array(up), np.cross(up, normal)
        own = [
            half * (out + a * right + b * above) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        faces.append(Face(np.array(own) @ to_world.T + box.centre, bgr(box.colour)))
    if box.picture:
        faces[0] = replace(faces[0], texture=load_picture(box.picture))
    return faces


def _faces_of_cylinder(cylinder):
    angles = np.linspace(0.0, 2.0 * math.pi, CYLINDER_SIDES, endpoint=False)
    rim = cylinder.radius * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    up = np.array([0.0, 0.0, cylinder.height / 2.0])
    bottom, top = cylinder.centre + rim - up, cylinder.centre + rim + up
    colour = bgr(cylinder.colour)
    sides = [
        Face(np.array([bottom[k - 1], bottom[k], top[k], top[k - 1]]), colour)
        for k in range(CYLINDER_SIDES)
    ]
    return [*sides, Face(top, colour), Face(bottom[::-1], colour)]


def _texture(floor):
    scale = min(_TEXELS_PER_METRE, _LARGEST_TEXTURE / max(floor.size))
    columns, rows = (max(round(length * scale), 1) for length in floor.size)
    if floor.texture == "checkers":
        # Lines between tiles go through the origin, the middle of the floor.
        x = np.floor((np.arange(columns) - columns / 2.0) / scale / TILE).astype(int)
        y = np.floor((np.arange(rows) - rows / 2.0) / scale / TILE).astype(int)
        light = np.where((x + y[:, None]) % 2 == 0, 1.0, 0.75)
    else:
        grains = np.random.default_rng(0).uniform(0.5, 1.0, (rows // 4 + 1, columns // 4 + 1))
        light = cv2.resize(grains, (columns, rows), interpolation=cv2.INTER_CUBIC)
    return np.clip(light[..., None] * bgr(floor.colour), 0.0, 255.0).astype(np.uint8)
