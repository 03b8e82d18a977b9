"""Tells catkin where the Python modules are."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["crazyflie_identification"], package_dir={"": "src"}))
