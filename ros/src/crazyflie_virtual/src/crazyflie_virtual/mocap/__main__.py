"""``python -m crazyflie_virtual.mocap``."""

from crazyflie_virtual.main import virtual_mocap

virtual_mocap()
