#!/usr/bin/env python
"""A constant thrust."""

from crazyflie_demo.const_thrust_node import ConstThrustNode
from crazyflie_utils import run

run(ConstThrustNode, "const_thrust")
