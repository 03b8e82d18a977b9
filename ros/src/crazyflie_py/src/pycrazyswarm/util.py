"""The name of `crazyflie_py.util` in Crazyswarm 1."""

from crazyflie_py.util import (
    check_ellipsoid_collisions,
    clamp_norm,
    grid_yaml,
    normalize,
    poisson_disk_sample,
)

__all__ = [
    "check_ellipsoid_collisions",
    "clamp_norm",
    "grid_yaml",
    "normalize",
    "poisson_disk_sample",
]
