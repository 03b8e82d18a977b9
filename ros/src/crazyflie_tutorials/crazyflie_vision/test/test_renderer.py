"""Objects are drawn at the places given by the camera's geometry."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from crazyflie_vision.camera import MountParameters, Pinhole, PixelNoise, Pose, optical_pose
from crazyflie_vision.renderer import SKY, Renderer
from crazyflie_world.shapes import Ball, Box, Cylinder, Wall
from crazyflie_world.world import Floor, World

CAMERA = Pinhole.with_fov(320, 240, 75.0)
FLOOR = Floor(size=(8.0, 8.0))
RED = (1.0, 0.0, 0.0)


def looking(roll=0.0, pitch=0.0, yaw=0.0, position=(0.0, 0.0, 1.0)):
    """Return the optical pose of a camera in the middle of a vehicle."""
    vehicle = Pose(Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix(), np.array(position))
    return vehicle @ optical_pose(MountParameters(x=0.0, z=0.0))


def render(objects, pose, floor=FLOOR):
    return Renderer(CAMERA, World(floor=floor, objects=tuple(objects))).render(pose)


def is_red(image):
    return image[..., 2].astype(int) > 2 * image[..., 1].astype(int) + 20


def project(point, pose):
    """Return pixel (x, y) of a point, and its depth, m; written down apart from the renderer."""
    x, y, z = pose.rotation.T @ (np.array(point) - pose.position)
    f = 160.0 / math.tan(math.radians(37.5))
    return 159.5 + f * x / z, 119.5 + f * y / z, z


ANGLE = st.floats(-0.3, 0.3)


@given(st.floats(0.6, 3.0), st.floats(-0.2, 0.2), st.floats(-0.15, 0.15), ANGLE, ANGLE, ANGLE)
def test_a_ball_is_where_it_is_projected(ahead, left, up, roll, pitch, yaw):
    # Where the camera looks, whatever its attitude; within the image.
    pose = looking(roll, pitch, yaw)
    vehicle = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    centre = pose.position + vehicle @ np.array([ahead, left * ahead, up * ahead])
    ball = Ball(name="ball", centre=tuple(centre), radius=0.1, colour=RED)
    mask = is_red(render([ball], pose, Floor(size=(0.1, 0.1))))
    x, y, depth = project(centre, pose)
    rows, columns = np.nonzero(mask)
    # The outline is an ellipse a little off the projected centre: by r^2 / d^2 of the angle.
    shift = 0.5 + 210.0 * 0.3 * (0.1 / ahead) ** 2
    assert columns.mean() == pytest.approx(x, abs=shift)
    assert rows.mean() == pytest.approx(y, abs=shift)
    f = CAMERA.focal_length
    assert math.sqrt(mask.sum() / math.pi) == pytest.approx(f * 0.1 / depth, rel=0.08, abs=0.6)


def test_what_is_nearer_covers():
    ball = Ball(name="ball", centre=(2.0, 0.0, 1.0), radius=0.2, colour=RED)
    box = Box(name="box", centre=(1.0, 0.5, 1.0), extent=(0.2, 1.0, 2.0))
    whole = is_red(render([ball], looking())).sum()
    half = is_red(render([ball, box], looking()))
    # The box is at the left, and ends at the ball's middle.
    assert half.sum() == pytest.approx(whole / 2, rel=0.1)
    assert not half[:, :158].any()
    behind = Wall(name="wall", start=(1.5, -2.0), end=(1.5, 2.0), height=2.0).box()
    assert not is_red(render([ball, behind], looking())).any()
    assert is_red(render([behind, ball], looking(position=(1.7, 0.0, 1.0)))).any()


@pytest.mark.parametrize("roll", [-0.3, 0.0, 0.3])
def test_the_horizon_is_level_in_the_world(roll):
    image = render([], looking(roll=roll), Floor(size=(4000.0, 4000.0), colour=(0.2, 0.2, 0.2)))
    is_sky = (image == np.array(SKY, dtype=np.uint8)).all(axis=2)
    for column in (20, 160, 300):
        # A roll to the right lifts the horizon's right end... as seen by who rolls: its left.
        row = np.argmin(is_sky[:, column])
        assert row == pytest.approx(119.5 - math.tan(roll) * (column - 159.5), abs=2.0)


def test_checkers_lie_in_the_world():
    floor = Floor(size=(4.0, 4.0), texture="checkers")
    image = render([], looking(pitch=math.radians(30.0)), floor)[..., 0].astype(int)
    pose = looking(pitch=math.radians(30.0))

    def seen(x, y):
        column, row, _ = project((x, y, 0.0), pose)
        return image[round(row), round(column)]

    # Tiles of 0.5 m that meet at the origin.
    assert seen(1.25, 0.25) == seen(1.75, -0.25) == seen(1.25, -0.75)
    assert seen(1.25, -0.25) == seen(1.75, 0.25)
    assert abs(seen(1.25, 0.25) - seen(1.25, -0.25)) > 20


def test_a_picture_is_upright_and_not_mirrored(tmp_path):
    picture = np.zeros((40, 80, 3), dtype=np.uint8)
    picture[:20, :40], picture[:20, 40:] = (255, 0, 0), (0, 255, 0)
    picture[20:, :40], picture[20:, 40:] = (0, 0, 255), (255, 255, 255)
    file = tmp_path / "picture.png"
    cv2.imwrite(str(file), picture)
    poster = Box(
        name="poster",
        centre=(1.0, 0.0, 1.0),
        extent=(0.1, 0.8, 0.4),
        yaw=math.pi,
        picture=str(file),
    )
    image = render([poster], looking())
    corners = [image[row, column] for row in (90, 150) for column in (100, 220)]
    assert [np.argmax(each) for each in corners[:3]] == [0, 1, 2]
    assert corners[3].min() > 100
    # The back is plain.
    back = render([poster], looking(yaw=math.pi, position=(2.0, 0.0, 1.0)))
    assert np.ptp(back[100:140, 120:200].reshape(-1, 3), axis=0).max() == 0


@pytest.mark.parametrize(("yaw", "centre"), [(90.0, (0.0, 1.0, 1.0)), (-90.0, (0.0, -1.0, 1.0))])
def test_a_camera_that_looks_aside(yaw, centre):
    ball = Ball(name="ball", centre=centre, radius=0.1, colour=RED)
    vehicle = Pose(np.eye(3), np.array([0.0, 0.0, 1.0]))
    image = render([ball], vehicle @ optical_pose(MountParameters(x=0.0, z=0.0, yaw=yaw)))
    rows, columns = np.nonzero(is_red(image))
    assert (columns.mean(), rows.mean()) == pytest.approx((159.5, 119.5), abs=0.5)


def test_a_camera_that_looks_down():
    vehicle = Pose(np.eye(3), np.array([0.0, 0.0, 1.0]))
    ball = Ball(name="ball", centre=(0.0, 0.0, 0.1), radius=0.1, colour=RED)
    image = render([ball], vehicle @ optical_pose(MountParameters(x=0.0, z=0.0, pitch=90.0)))
    rows, columns = np.nonzero(is_red(image))
    assert (columns.mean(), rows.mean()) == pytest.approx((159.5, 119.5), abs=0.5)


def test_a_cylinder_has_its_width_and_height():
    pillar = Cylinder(name="pillar", centre=(2.0, 0.0, 1.0), radius=0.2, height=0.8, colour=RED)
    rows, columns = np.nonzero(is_red(render([pillar], looking())))
    f = CAMERA.focal_length
    assert np.ptp(columns) == pytest.approx(2.0 * f * 0.2 / 2.0, abs=3.0)
    assert np.ptp(rows) == pytest.approx(f * 0.8 / 1.8, abs=3.0)


PLACE = st.tuples(*3 * [st.floats(-2.5, 2.5)])


@given(PLACE, st.floats(-3.2, 3.2), st.floats(-3.2, 3.2), st.floats(-3.2, 3.2))
def test_any_pose_gives_an_image(position, roll, pitch, yaw):
    objects = (
        Ball(name="ball", centre=(0.5, 0.0, 0.0), radius=0.5, colour=RED),
        Box(name="box", centre=(-1.0, 0.0, 0.0), extent=(1.0, 1.0, 1.0), yaw=0.3),
        Cylinder(name="pillar", centre=(0.0, 1.0, 0.0), radius=0.3, height=1.0),
        Wall(name="wall", start=(-3.0, 2.0), end=(3.0, 2.0)).box(),
    )
    with np.errstate(all="raise", under="ignore"):
        floor = Floor(size=(5.0, 5.0), texture="speckles")
        image = render(objects, looking(roll, pitch, yaw, position), floor)
    assert image.shape == (240, 320, 3)
    assert image.dtype == np.uint8


def test_noise_has_its_deviation_and_no_mean():
    grey = np.full((240, 320, 3), 128, dtype=np.uint8)
    noise = PixelNoise(320, 240, 5.0)
    one, other = (noise.add(grey).astype(float) - 128.0 for _ in range(2))
    assert one.std() == pytest.approx(5.0, rel=0.05)
    assert one.mean() == pytest.approx(0.0, abs=0.1)
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.05
    assert (PixelNoise(320, 240, 0.0).add(grey) == grey).all()
