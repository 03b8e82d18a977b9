"""Tells catkin where the Python modules are."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        # Crazyswarm's scripts import the second name, crazyswarm2's the first.
        packages=["crazyflie_py", "pycrazyswarm"],
        package_dir={"": "src"},
    )
)
