"""Crazyswarm's scripting API; scripts of Crazyswarm 1 import it as pycrazyswarm."""

from crazyflie_py.crazyswarm_py import Crazyswarm

__all__ = ["Crazyswarm"]
