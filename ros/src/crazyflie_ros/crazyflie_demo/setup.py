"""Tells catkin where the Python modules are."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        # crazyflie and uav_trajectory are what users' scripts import. Packages and not modules, of
        # which catkin makes empty ones in a devel space.
        packages=["crazyflie", "crazyflie_demo", "uav_trajectory"],
        package_dir={"": "src"},
    )
)
