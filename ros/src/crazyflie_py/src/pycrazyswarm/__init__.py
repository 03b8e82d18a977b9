"""The name under which scripts of Crazyswarm 1 import `crazyflie_py`."""

from crazyflie_py import Crazyswarm

__all__ = ["Crazyswarm"]
