#!/usr/bin/env python
"""A constant thrust."""

from crazyflie_utils import run

run("crazyflie_demo.const_thrust_node:ConstThrustNode", "const_thrust")
