"""The name of `crazyflie_py.crazyflie` in Crazyswarm 1."""

from crazyflie_py.crazyflie import Crazyflie, CrazyflieServer, TimeHelper

__all__ = ["Crazyflie", "CrazyflieServer", "TimeHelper"]
