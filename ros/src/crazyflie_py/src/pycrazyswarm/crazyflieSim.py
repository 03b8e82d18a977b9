"""The same classes as for real vehicles, by their name in Crazyswarm 1."""

from crazyflie_py.crazyflie import Crazyflie, CrazyflieServer, TimeHelper

__all__ = ["Crazyflie", "CrazyflieServer", "TimeHelper"]
