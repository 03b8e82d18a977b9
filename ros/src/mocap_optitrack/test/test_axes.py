"""Axes, against scipy's rotations."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from crazyflie_model.angles import zyx_from_quaternion
from mocap_optitrack.frames import normalized, to_z_up

COMPONENT = st.floats(-1.0, 1.0)
QUATERNIONS = (
    st.tuples(COMPONENT, COMPONENT, COMPONENT, COMPONENT)
    .filter(lambda q: math.hypot(*q) > 0.1)
    .map(lambda q: tuple(part / math.hypot(*q) for part in q))
)
POSITIONS = st.tuples(*[st.floats(-10.0, 10.0)] * 3)

Z_UP_FROM_Y_UP = Rotation.from_euler("x", math.pi / 2.0)


@given(POSITIONS, QUATERNIONS)
def test_a_stream_with_z_up_is_taken_as_it_is(position, quaternion):
    assert to_z_up("z", position, quaternion) == (position, quaternion)


@given(POSITIONS, QUATERNIONS)
def test_a_stream_with_y_up_is_turned_about_x(position, quaternion):
    turned_position, turned_quaternion = to_z_up("y", position, quaternion)
    assert turned_position == pytest.approx(tuple(Z_UP_FROM_Y_UP.apply(position)), abs=1e-12)
    # The axes of the world and those of the body are turned.
    expected = Z_UP_FROM_Y_UP * Rotation.from_quat(quaternion) * Z_UP_FROM_Y_UP.inv()
    error = Rotation.from_quat(turned_quaternion) * expected.inv()
    assert error.magnitude() == pytest.approx(0.0, abs=1e-7)


def test_what_goes_up_with_y_up_goes_up():
    assert to_z_up("y", (0.0, 1.5, 0.0), (0.0, 0.0, 0.0, 1.0)) == (
        (0.0, 0.0, 1.5),
        (0.0, 0.0, 0.0, 1.0),
    )


def test_a_turn_about_the_vertical_stays_one():
    half = math.sin(0.2), math.cos(0.2)
    _, quaternion = to_z_up("y", (0.0, 0.0, 0.0), (0.0, half[0], 0.0, half[1]))
    assert zyx_from_quaternion(quaternion)[2] == pytest.approx(0.4)


@given(QUATERNIONS)
def test_heading_is_the_direction_of_the_x_axis(quaternion):
    x, y, _ = Rotation.from_quat(quaternion).apply([1.0, 0.0, 0.0])
    if math.hypot(x, y) > 1e-6:
        assert math.remainder(
            zyx_from_quaternion(quaternion)[2] - math.atan2(y, x), 2.0 * math.pi
        ) == (pytest.approx(0.0, abs=1e-6))


def test_quaternions_get_norm_1():
    assert math.hypot(*normalized((0.0, 0.6, 0.0, 0.8001))) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    "quaternion",
    [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.1), (0.0, 0.0, math.nan, 1.0), (math.inf, 0, 0, 1)],
)
def test_what_is_no_rotation_is_refused(quaternion):
    assert normalized(quaternion) is None
