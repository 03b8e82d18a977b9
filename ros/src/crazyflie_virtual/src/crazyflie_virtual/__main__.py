"""``python -m crazyflie_virtual``."""

from crazyflie_virtual.main import virtual_crazyflie

virtual_crazyflie()
