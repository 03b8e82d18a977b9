"""Angles against scipy, closed forms and each other."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from crazyflie_model.angles import (
    quaternion_from_rpy,
    quaternion_from_zyx,
    rotate,
    rotate_back,
    rotate_by_yaw,
    rpy_from_quaternion,
    turned,
    wrap_to_pi,
    zyx_from_quaternion,
)

ANGLE = st.floats(-math.pi, math.pi)
PITCH = st.floats(-1.5, 1.5)
FINITE = st.floats(-1e6, 1e6)


def same_rotation(p, q, tolerance=1e-12):
    """Tell whether two quaternions turn alike: q and -q do."""
    return abs(abs(np.dot(p, q)) - 1.0) < tolerance


@given(ANGLE, ANGLE, ANGLE)
def test_quaternion_is_scipys(roll, pitch, yaw):
    quaternion = quaternion_from_rpy(roll, pitch, yaw)
    assert same_rotation(quaternion, Rotation.from_euler("XYZ", (roll, pitch, yaw)).as_quat())
    assert np.linalg.norm(quaternion) == pytest.approx(1.0)


@given(ANGLE, PITCH, ANGLE)
def test_rpy_comes_back(roll, pitch, yaw):
    back = rpy_from_quaternion(*quaternion_from_rpy(roll, pitch, yaw))
    errors = [wrap_to_pi(a - b) for a, b in zip(back, (roll, pitch, yaw), strict=True)]
    assert errors == pytest.approx([0.0, 0.0, 0.0], abs=1e-7)


@given(st.tuples(*[st.floats(-1.0, 1.0)] * 4), st.floats(0.1, 10.0))
def test_any_quaternion_comes_back(quaternion, scale):
    norm = np.linalg.norm(quaternion)
    if norm < 1e-3:
        return
    roll, pitch, yaw = rpy_from_quaternion(*(scale * q for q in quaternion))
    assert abs(pitch) <= math.pi / 2
    back = quaternion_from_rpy(roll, pitch, yaw)
    # At pitch = +-pi/2 the asin costs half of the digits.
    assert same_rotation(np.array(quaternion) / norm, back, tolerance=1e-6)


@pytest.mark.parametrize("pitch", [-math.pi / 2, math.pi / 2])
def test_gimbal_lock_still_gives_the_rotation(pitch):
    quaternion = quaternion_from_rpy(0.3, pitch, 0.4)
    assert same_rotation(quaternion, quaternion_from_rpy(*rpy_from_quaternion(*quaternion)), 1e-6)


def test_order_is_not_that_of_tf():
    rotation = Rotation.from_quat(quaternion_from_rpy(0.3, -0.4, 1.1))
    assert rotation.as_euler("XYZ") == pytest.approx([0.3, -0.4, 1.1])
    assert rotation.as_euler("xyz") != pytest.approx([0.3, -0.4, 1.1], abs=0.01)


def test_rotation_matrix_is_as_documented():
    roll, pitch, yaw = 0.3, -0.4, 1.1
    matrix = Rotation.from_quat(quaternion_from_rpy(roll, pitch, yaw)).as_matrix()
    axes = [
        Rotation.from_euler(axis, angle).as_matrix()
        for axis, angle in zip("xyz", (roll, pitch, yaw), strict=True)
    ]
    np.testing.assert_allclose(matrix, axes[0] @ axes[1] @ axes[2], atol=1e-15)
    assert math.atan2(-matrix[1, 2], matrix[2, 2]) == pytest.approx(roll)
    assert math.asin(matrix[0, 2]) == pytest.approx(pitch)
    assert math.atan2(-matrix[0, 1], matrix[0, 0]) == pytest.approx(yaw)


def test_zero_quaternion_is_refused():
    with pytest.raises(ValueError, match="not a rotation"):
        rpy_from_quaternion(0.0, 0.0, 0.0, 0.0)


@given(FINITE)
def test_wrapping_keeps_the_direction(angle):
    wrapped = wrap_to_pi(angle)
    assert isinstance(wrapped, float)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@given(ANGLE)
def test_wrapping_leaves_what_is_in_range(angle):
    assert abs(wrap_to_pi(angle)) == pytest.approx(abs(angle), abs=1e-15)


def test_wrapping_works_on_arrays():
    angles = np.array([[0.0, 3.5], [-3.5, 7.0]])
    expected = [[0.0, 3.5 - 2 * math.pi], [2 * math.pi - 3.5, 7.0 - 2 * math.pi]]
    np.testing.assert_allclose(wrap_to_pi(angles), expected, atol=1e-15)


@given(FINITE, FINITE, ANGLE)
def test_rotation_by_yaw_is_scipys(x, y, yaw):
    expected = Rotation.from_euler("z", yaw).apply([x, y, 0.0])[:2]
    assert rotate_by_yaw(x, y, yaw) == pytest.approx(expected, abs=1e-6)


@given(arrays(float, (3, 5), elements=st.floats(-3.0, 3.0)))
def test_many_vectors_are_turned_as_each_by_itself(vectors):
    each = [rotate_by_yaw(*vector) for vector in vectors.T.tolist()]
    np.testing.assert_allclose(rotate_by_yaw(*vectors), np.transpose(each), atol=1e-12)


@given(FINITE, FINITE, ANGLE)
def test_rotation_by_yaw_is_undone(x, y, yaw):
    assert rotate_by_yaw(*rotate_by_yaw(x, y, yaw), -yaw) == pytest.approx((x, y), abs=1e-6)


UNITS = st.tuples(*[st.floats(-1.0, 1.0)] * 4).map(np.array)
QUATERNIONS = UNITS.filter(lambda q: np.linalg.norm(q) > 0.1).map(
    lambda q: (q / np.linalg.norm(q)).tolist()
)


@given(QUATERNIONS)
def test_the_firmware_s_angles(quaternion):
    roll, pitch, yaw = zyx_from_quaternion(quaternion)
    # Nose straight up or down, roll and yaw are not unique.
    assume(abs(math.sin(pitch)) < 0.999)
    assert same_rotation(Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat(), quaternion)
    assert same_rotation(quaternion_from_zyx(roll, pitch, yaw), quaternion)


@given(QUATERNIONS, st.tuples(*[st.floats(-10.0, 10.0)] * 3))
def test_rotated_vectors(quaternion, vector):
    np.testing.assert_allclose(
        rotate(quaternion, vector), Rotation.from_quat(quaternion).apply(vector), atol=1e-12
    )
    np.testing.assert_allclose(
        rotate_back(quaternion, rotate(quaternion, vector)), vector, atol=1e-12
    )


def test_nose_straight_down_is_no_more_than_a_quarter_turn_in_spite_of_rounding():
    # 2 w y / (w^2 + y^2) is 1.0000000000000002.
    w, y = 2.0908031771193314, 2.090803183391741
    assert rpy_from_quaternion(0.0, y, 0.0, w) == pytest.approx((0.0, math.pi / 2.0, 0.0))
    assert rpy_from_quaternion(0.0, -y, 0.0, w) == pytest.approx((0.0, -math.pi / 2.0, 0.0))


def test_a_float_stays_one():
    assert type(wrap_to_pi(4.0)) is float


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_the_firmware_s_pitch_ends_at_a_quarter_turn_in_spite_of_rounding(sense):
    # 2 w y is 1.0000000000000002.
    half = 0.7071067811865476
    _, pitch, _ = zyx_from_quaternion((0.0, sense * half, 0.0, half))
    assert pitch == pytest.approx(sense * math.pi / 2.0)


@given(ANGLE, PITCH, ANGLE, st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_a_turn_by_a_rotation_vector_is_scipys(roll, pitch, yaw, rotation):
    quaternion = quaternion_from_rpy(roll, pitch, yaw)
    expected = Rotation.from_quat(quaternion) * Rotation.from_rotvec(rotation)
    assert same_rotation(turned(quaternion, rotation), expected.as_quat())


def test_a_turn_of_nothing_is_none():
    assert turned([0.0, 0.0, 0.6, 0.8], [0.0, 0.0, 0.0]) == (0.0, 0.0, 0.6, 0.8)
