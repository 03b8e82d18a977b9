"""``python -m crazyflie_virtual``."""

from crazyflie_virtual.server import virtual_crazyflie

virtual_crazyflie()
