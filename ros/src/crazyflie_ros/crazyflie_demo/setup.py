"""Tells catkin where the Python modules are."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        # Users' scripts import crazyflie and uav_trajectory. They are packages, since catkin
        # creates empty modules in a devel space.
        packages=["crazyflie", "crazyflie_demo", "uav_trajectory"],
        package_dir={"": "src"},
    )
)
