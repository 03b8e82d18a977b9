"""Tells catkin where the Python modules are."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

PACKAGES = [
    "crazyflie_virtual",
    "crazyflie_virtual.body",
    "crazyflie_virtual.firmware",
    "crazyflie_virtual.link",
    "crazyflie_virtual.mocap",
    "crazyflie_virtual.ports",
    "crazyflie_virtual.tables",
]

setup(**generate_distutils_setup(packages=PACKAGES, package_dir={"": "src"}))
