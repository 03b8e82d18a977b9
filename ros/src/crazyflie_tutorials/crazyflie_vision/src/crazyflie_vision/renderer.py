"""The image of a world in a camera: flat faces, plain or with a picture on them.

Everything is drawn into a buffer with the depth of each pixel (Catmull, A Subdivision Algorithm for
Computer Display of Curved Surfaces, 1974). It contains the inverse depth, which on a plane is
linear in the pixel's coordinates.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache, cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from crazyflie_vision.camera import Pinhole, Pose
from crazyflie_world.shapes import Ball, Box, Colour, Cylinder, Shape
from crazyflie_world.world import Floor, World

Image = NDArray[np.uint8]  #: Rows, columns and, for colour, blue, green, red.
LIGHT = np.array([-0.36, 0.28, 0.89])  #: Direction to the light, length 1.
AMBIENT = 0.6  #: Fraction of the brightness of a face without direct light.

CYLINDER_SIDES = 20

TILE = 0.5  #: Side of the checkers of a floor, m.

_TEXELS_PER_METRE = 80
_LARGEST_TEXTURE = 2048


@dataclass(frozen=True)
class Face:
    """A flat convex polygon that is visible from one side."""

    #: Shape (n, 3). Counter-clockwise as seen from outside, m, world frame.
    corners: NDArray[np.float64]
    colour: NDArray[np.float64]  #: Shape (3,). Blue, green, red, from 0 to 255.
    #: Picture on a face with four corners: they are those at the lower left, lower
    #: right, upper right and upper left.
    texture: Image | None = None

    @cached_property
    def normal(self) -> NDArray[np.float64]:
        """Outward normal of length 1, shape (3,)."""
        a, b, c = self.corners[:3]
        cross = np.cross(b - a, c - b)
        return cross / np.linalg.norm(cross)

    @property
    def shade(self) -> float:
        """Fraction of the colour's brightness."""
        return AMBIENT + (1.0 - AMBIENT) * max(float(self.normal @ LIGHT), 0.0)


def bgr(colour: Colour) -> NDArray[np.float64]:
    """Return a colour (red, green, blue from 0 to 1) as OpenCV has it."""
    return 255.0 * np.array(colour[::-1])


#: Corners of a box about its vertical axis, in half lengths. The side from the last to the first
#: one is the front.
_BOX_RIM = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


def faces_of(shape: Shape) -> list[Face]:
    """Return the faces of a box, its front first, or of a cylinder; of other shapes, none."""
    if isinstance(shape, Cylinder):
        angles = np.linspace(0.0, 2.0 * math.pi, CYLINDER_SIDES, endpoint=False)
        return _faces_of_prism(
            shape, shape.radius * np.column_stack([np.cos(angles), np.sin(angles)])
        )
    if not isinstance(shape, Box):
        return []
    c, s = math.cos(shape.yaw), math.sin(shape.yaw)
    rim = _BOX_RIM * shape.extent[:2] / 2.0 @ np.array([[c, s], [-s, c]])
    front, *others = _faces_of_prism(shape, rim)
    if shape.picture:
        front = replace(front, texture=load_picture(shape.picture))
    return [front, *others]


def _faces_of_prism(shape, rim):
    # The rim, counter-clockwise about the vertical through the centre, has shape (n, 2).
    middle = np.column_stack([rim, np.zeros(len(rim))]) + shape.centre
    up = np.array([0.0, 0.0, shape.size[2] / 2.0])
    bottom, top = middle - up, middle + up
    sides = [np.array([bottom[k - 1], bottom[k], top[k], top[k - 1]]) for k in range(len(rim))]
    return [Face(corners, bgr(shape.colour)) for corners in (*sides, top, bottom[::-1])]


def face_of(floor: Floor) -> Face:
    """Return the upper side of a floor."""
    x, y = (0.5 * length for length in floor.size)
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    texture = None if floor.texture == "plain" else _texture(floor)
    return Face(corners, bgr(floor.colour), texture)


@cache
def load_picture(path: str) -> Image:
    """Return the picture in a file; OSError if OpenCV cannot read it."""
    picture = cv2.imread(path, cv2.IMREAD_COLOR)
    if picture is None:
        raise OSError(f"{path} is not a picture that can be read")
    return picture


def _texture(floor):
    scale = min(_TEXELS_PER_METRE, _LARGEST_TEXTURE / max(floor.size))
    columns, rows = (max(round(length * scale), 1) for length in floor.size)
    if floor.texture == "checkers":
        # Lines between tiles pass through the origin, the middle of the floor.
        x = np.floor((np.arange(columns) - columns / 2.0) / scale / TILE).astype(int)
        y = np.floor((np.arange(rows) - rows / 2.0) / scale / TILE).astype(int)
        light = np.where((x + y[:, None]) % 2 == 0, 1.0, 0.75)
    else:
        grains = np.random.default_rng(0).uniform(0.5, 1.0, (rows // 4 + 1, columns // 4 + 1))
        light = cv2.resize(grains, (columns, rows), interpolation=cv2.INTER_CUBIC)
    return np.clip(light[..., None] * bgr(floor.colour), 0.0, 255.0).astype(np.uint8)


NEAR = 0.02  #: Distance from the camera's plane below which nothing is drawn (m).
SKY = (225.0, 215.0, 205.0)  #: Background colour: blue, green, red.

_SUBPIXEL_BITS = 4


class Renderer:
    """Draws images of a world whose objects may move; those without a path are prepared once.

    OSError: a picture of a box cannot be read.
    """

    def __init__(self, camera: Pinhole, world: World):
        self._camera = camera
        (cx, cy), f = camera.centre, camera.focal_length
        self._x = ((np.arange(camera.width) - cx) / f).astype(np.float32)
        self._y = ((np.arange(camera.height)[:, None] - cy) / f).astype(np.float32)
        self._floor = face_of(world.floor)
        self._still = [each for each in world.objects if each.path is None]
        self._still_faces = [face for each in self._still for face in faces_of(each)]
        for each in world.moving:
            # Pictures are loaded now, so that errors are reported now.
            faces_of(each)

    def render(self, pose: Pose, moving: Iterable[Shape] = ()) -> Image:
        """Return the image from a pose of the optical frame in the world, see `Image`.

        ``moving`` are the moving objects at their present positions.
        """
        camera = self._camera
        self._image = np.full((camera.height, camera.width, 3), SKY, dtype=np.uint8)
        self._inverse_depth = np.zeros((camera.height, camera.width), dtype=np.float32)
        moving = tuple(moving)
        for shape in (*self._still, *moving):
            if isinstance(shape, Ball):
                self._draw_ball(shape, pose)
        for face in (*self._still_faces, *(face for each in moving for face in faces_of(each))):
            self._draw_face(face, pose)
        self._draw_face(self._floor, pose)
        return self._image

    def _draw_face(self, face: Face, pose: Pose) -> None:
        height = face.normal @ (pose.position - face.corners[0])
        if height < 1e-6:
            return
        corners = (face.corners - pose.position) @ pose.rotation
        seen = _clipped(corners)
        if len(seen) < 3:
            return
        camera = self._camera
        pixels = camera.focal_length * seen[:, :2] / seen[:, 2:] + camera.centre
        patch = self._patch(*np.transpose([pixels.min(axis=0), pixels.max(axis=0)]))
        if patch is None:
            return
        rows, columns = patch
        corner = (columns.start, rows.start)
        mask = np.zeros_like(self._inverse_depth[patch], dtype=np.uint8)
        points = np.round((pixels - corner) * 2**_SUBPIXEL_BITS).astype(np.int32)
        cv2.fillConvexPoly(mask, points, 1, shift=_SUBPIXEL_BITS)
        a, b, c = (pose.rotation.T @ face.normal / -height).astype(np.float32)
        inverse_depth = a * self._x[columns] + (b * self._y[rows] + c)
        # Pixels on the rim lie a little beyond the face.
        nearest, furthest = seen[:, 2].min(), seen[:, 2].max()
        np.clip(inverse_depth, 1.0 / furthest, 1.0 / nearest, out=inverse_depth)
        colours = face.shade * face.colour
        if face.texture is not None:
            colours = self._warped(face, corners, corner, mask.shape)
        self._put(patch, mask.view(bool), inverse_depth, colours)

    def _warped(self, face, corners, corner, shape):
        # Transformation from texels to the plane, to the optical frame, to pixels of the patch.
        rows, columns = face.texture.shape[:2]
        lower_left, _, upper_right, upper_left = corners
        right, down = (upper_right - upper_left) / columns, (lower_left - upper_left) / rows
        plane = np.column_stack([right, down, upper_left])
        matrix = self._camera.matrix.copy()
        matrix[:2, 2] -= corner
        warped = cv2.warpPerspective(
            face.texture, matrix @ plane, shape[::-1], borderMode=cv2.BORDER_REPLICATE
        )
        return cv2.convertScaleAbs(warped, alpha=face.shade)

    def _draw_ball(self, ball: Ball, pose: Pose) -> None:
        centre = (np.array(ball.centre) - pose.position) @ pose.rotation
        x, y, z = centre
        camera = self._camera
        if np.linalg.norm(centre) <= ball.radius + NEAR or z < -ball.radius:
            return
        patch = self._patch(
            _silhouette(x, z, ball.radius, camera.focal_length, camera.centre[0]),
            _silhouette(y, z, ball.radius, camera.focal_length, camera.centre[1]),
        )
        if patch is None:
            return
        # |t d - c|^2 = r^2 with d = (x, y, 1), so that t is the depth.
        dx, dy = self._x[patch[1]], self._y[patch[0]]
        x, y, z, radius = (np.float32(value) for value in (x, y, z, ball.radius))
        a = dx * dx + (dy * dy + np.float32(1.0))
        b = dx * x + (dy * y + z)
        discriminant = b * b - a * (x * x + y * y + z * z - radius * radius)
        depth = (b - np.sqrt(np.maximum(discriminant, 0.0))) / a
        mask = (discriminant > 0.0) & (depth > NEAR)
        lx, ly, lz = (LIGHT @ pose.rotation / ball.radius).astype(np.float32)
        cosine = depth * (dx * lx + (dy * ly + lz)) - np.float32(lx * x + ly * y + lz * z)
        light = np.float32(AMBIENT) + np.float32(1.0 - AMBIENT) * np.maximum(cosine, 0.0)
        colours = np.minimum(light[..., None] * bgr(ball.colour).astype(np.float32), 255.0)
        self._put(patch, mask, 1.0 / np.maximum(depth, np.float32(NEAR)), colours.astype(np.uint8))

    def _patch(self, columns, rows):
        # Rows and columns of the image, each from the first to the last; None for none.
        patch = tuple(
            slice(math.floor(max(first, 0.0)), math.ceil(min(last + 1.0, count)))
            for (first, last), count in ((rows, self._camera.height), (columns, self._camera.width))
        )
        return patch if all(part.start < part.stop for part in patch) else None

    def _put(self, patch, mask, inverse_depth, colours):
        held = self._inverse_depth[patch]
        nearer = mask & (inverse_depth > held)
        np.copyto(held, inverse_depth, where=nearer)
        if colours.ndim == 1:
            self._image[patch][nearer] = colours.astype(np.uint8)
        else:
            cv2.copyTo(colours, nearer.view(np.uint8), self._image[patch])


def _clipped(corners):
    # The part of a convex polygon beyond the near plane (Sutherland and Hodgman, 1974).
    if np.all(corners[:, 2] >= NEAR):
        return corners
    kept = []
    for begin, end in zip(np.roll(corners, 1, axis=0), corners, strict=False):
        share = begin[2] - NEAR, end[2] - NEAR
        if (share[0] >= 0.0) != (share[1] >= 0.0):
            kept.append(begin + (end - begin) * share[0] / (share[0] - share[1]))
        if share[1] >= 0.0:
            kept.append(end)
    return np.array(kept).reshape(-1, 3)


def _silhouette(offset, depth, radius, focal_length, centre):
    # First and last pixel of a ball along one axis of the image, from its tangents.
    distance = math.hypot(offset, depth)
    if distance <= radius:
        return -math.inf, math.inf
    middle, half = math.atan2(offset, depth), math.asin(radius / distance)
    limit = 0.5 * math.pi - 1e-3
    angles = (min(max(angle, -limit), limit) for angle in (middle - half, middle + half))
    return tuple(centre + focal_length * math.tan(angle) for angle in angles)
