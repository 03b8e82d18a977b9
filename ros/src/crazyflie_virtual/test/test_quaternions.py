"""Quaternions in 32 bits, and rotations, against cflib and scipy."""

import numpy as np
from cflib.utils.encoding import compress_quaternion as reference
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from crazyflie_virtual.firmware.compressed import compress_quaternion, decompress_quaternion
from crazyflie_virtual.rotations import rotate, rotate_back

COMPONENTS = st.tuples(*[st.floats(-1.0, 1.0)] * 4)


def unit(components):
    vector = np.array(components)
    assume(np.linalg.norm(vector) > 0.1)
    return tuple((vector / np.linalg.norm(vector)).tolist())


@given(COMPONENTS)
def test_compression_is_the_clients(components):
    quaternion = unit(components)
    assert compress_quaternion(quaternion) == reference(quaternion)


@given(COMPONENTS)
def test_compressed_quaternions_come_back(components):
    quaternion = unit(components)
    returned = np.array(decompress_quaternion(compress_quaternion(quaternion)))
    # The same rotation, perhaps with the other sign; 9 bits of magnitude.
    assert abs(np.dot(returned, quaternion)) > 1.0 - 1e-5


@given(COMPONENTS, st.tuples(*[st.floats(-10.0, 10.0)] * 3))
def test_rotations_agree_with_scipy(components, vector):
    quaternion = unit(components)
    np.testing.assert_allclose(
        rotate(quaternion, vector), Rotation.from_quat(quaternion).apply(vector), atol=1e-12
    )
    np.testing.assert_allclose(
        rotate_back(quaternion, rotate(quaternion, vector)), vector, atol=1e-12
    )
