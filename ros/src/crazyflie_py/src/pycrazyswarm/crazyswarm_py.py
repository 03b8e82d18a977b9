"""The name of `crazyflie_py.crazyswarm_py` in Crazyswarm 1."""

from crazyflie_py.crazyswarm_py import Crazyswarm, build_argparser

__all__ = ["Crazyswarm", "build_argparser"]
