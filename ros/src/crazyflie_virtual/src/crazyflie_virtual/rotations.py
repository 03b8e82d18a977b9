"""Vectors between body and fixed frame."""


def rotate(quaternion, vector) -> tuple:
    """Return a vector given in the body frame in the fixed frame.

    Parameters
    ----------
    quaternion : sequence, 4 components
        (x, y, z, w), of norm 1, from body to fixed frame.
    vector : sequence, 3 components
    """
    x, y, z, w = quaternion
    a, b, c = vector
    # R v = v + 2 w (u x v) + 2 u x (u x v), with u the quaternion's vector part.
    p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 2.0 * (w * p + y * r - z * q),
        b + 2.0 * (w * q + z * p - x * r),
        c + 2.0 * (w * r + x * q - y * p),
    )


def rotate_back(quaternion, vector) -> tuple:
    """Return a vector given in the fixed frame in the body frame; inverse of `rotate`."""
    x, y, z, w = quaternion
    return rotate((-x, -y, -z, w), vector)
