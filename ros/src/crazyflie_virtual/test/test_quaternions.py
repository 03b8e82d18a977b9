"""Quaternions in 32 bits, against cflib."""

import numpy as np
from cflib.utils.encoding import compress_quaternion as reference
from hypothesis import assume, given
from hypothesis import strategies as st

from crazyflie_virtual.quaternions import compress_quaternion, decompress_quaternion

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
