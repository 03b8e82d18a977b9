"""Tells catkin where the Python modules are."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

FOLDERS = ("journal", "parameters", "ros1", "testing", "tf")
PACKAGES = ["crazyflie_utils", *(f"crazyflie_utils.{folder}" for folder in FOLDERS)]

setup(**generate_distutils_setup(packages=PACKAGES, package_dir={"": "src"}))
