"""Tells catkin where the Python modules are."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

PACKAGES = ["crazyflie_link", "crazyflie_link.testing"]

setup(**generate_distutils_setup(packages=PACKAGES, package_dir={"": "src"}))
